//! What can be wrong, as the code and the message that a host gets.

use spba_ceres::config::ConfigError;
use spba_ceres::init::InitError;
use spba_ceres::objective::ObjectiveError;
use spba_ceres::prior::{InvalidPrior, PriorError};
use spba_ceres::sequence::SequenceError;
use spba_ceres::solver::SolveError;

/// `spba_code`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Code {
    Ok = 0,
    InvalidInput = 1,
    InvalidPrior = 2,
    InvalidOptions = 3,
    Interrupted = 4,
    NoSolution = 5,
    NotThere = 6,
    Internal = 7,
}

/// Why a call failed; every message is one line that names what is wrong and how to mend it.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    #[error("{what}: {problem}; {mend}")]
    Input {
        what: String,
        problem: String,
        mend: &'static str,
    },
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    #[error(transparent)]
    Prior(#[from] PriorError),
    #[error("the linear prior: {0}; give arrays as spba.h describes them")]
    LinearPrior(#[from] InvalidPrior),
    #[error(transparent)]
    Options(#[from] ConfigError),
    #[error("options: `{key}` is {problem}; {mend}")]
    Option {
        key: &'static str,
        problem: &'static str,
        mend: &'static str,
    },
    #[error("options: {0}; give another")]
    Target(String),
    #[error("the observer stopped the solve before there was a starting point; nothing to mend")]
    Interrupted,
    #[error(transparent)]
    Init(InitError),
    #[error(transparent)]
    Solve(SolveError),
    #[error("{0}: not there; see when spba.h says that it is")]
    NotThere(&'static str),
    #[error("threads: {0}; give fewer")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    #[error("spba failed within itself: {0}; report it with the input")]
    Panic(String),
}

impl From<InitError> for Fault {
    fn from(error: InitError) -> Self {
        match error {
            InitError::Interrupted => Self::Interrupted,
            error => Self::Init(error),
        }
    }
}

impl From<SolveError> for Fault {
    fn from(error: SolveError) -> Self {
        Self::Solve(error)
    }
}

impl From<ObjectiveError> for Fault {
    fn from(error: ObjectiveError) -> Self {
        Self::Solve(error.into())
    }
}

impl Fault {
    pub fn input(what: impl Into<String>, problem: impl Into<String>, mend: &'static str) -> Self {
        Self::Input {
            what: what.into(),
            problem: problem.into(),
            mend,
        }
    }

    pub fn code(&self) -> Code {
        match self {
            Self::Input { .. } | Self::Sequence(_) => Code::InvalidInput,
            Self::Prior(_) | Self::LinearPrior(_) => Code::InvalidPrior,
            Self::Options(_) | Self::Option { .. } | Self::Target(_) => Code::InvalidOptions,
            Self::Interrupted => Code::Interrupted,
            Self::Init(InitError::Option { .. }) => Code::InvalidOptions,
            Self::Init(InitError::NothingFits { .. }) => Code::NoSolution,
            Self::Init(_) => Code::InvalidInput,
            Self::Solve(SolveError::Option(..) | SolveError::Objective(ObjectiveError::Option(..))) => {
                Code::InvalidOptions
            }
            Self::Solve(_) => Code::NoSolution,
            Self::NotThere(_) => Code::NotThere,
            Self::Threads(_) | Self::Panic(_) => Code::Internal,
        }
    }
}
