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
    /// The call succeeded.
    Ok = 0,
    /// A frame or an argument is wrong.
    InvalidInput = 1,
    /// A file or arrays are no shape prior.
    InvalidPrior = 2,
    /// An option is unknown or out of range.
    InvalidOptions = 3,
    /// The observer stopped the solve before there was any solution.
    Interrupted = 4,
    /// No pose fits the masks, or the objective cannot be evaluated.
    NoSolution = 5,
    /// What is asked for does not exist, such as a similarity without poses.
    NotThere = 6,
    /// The library failed, not its input.
    Internal = 7,
}

/// Why a call failed; every message is one line that names what is wrong and how to mend it.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// An argument is wrong.
    #[error("{what}: {problem}; {mend}")]
    Input {
        /// The argument or its part, such as `frames[3].mask`.
        what: String,
        /// What is wrong with it.
        problem: String,
        /// How to mend it.
        mend: &'static str,
    },
    /// The frames together do not make a sequence.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// A prior file cannot be used.
    #[error(transparent)]
    Prior(#[from] PriorError),
    /// The arrays of a linear prior do not fit together.
    #[error("the linear prior: {0}; give arrays as spba.h describes them")]
    LinearPrior(#[from] InvalidPrior),
    /// The options are no TOML, or a key in them is unknown.
    #[error(transparent)]
    Options(#[from] ConfigError),
    /// An option is out of range or about files.
    #[error("options: `{key}` is {problem}; {mend}")]
    Option {
        /// The option's key.
        key: &'static str,
        /// What is wrong with its value.
        problem: &'static str,
        /// How to mend it.
        mend: &'static str,
    },
    /// The target frame does not exist. The field says which there are.
    #[error("options: {0}; give another")]
    Target(String),
    /// The observer stopped the solve before there was a starting point.
    #[error("the observer stopped the solve before there was a starting point; nothing to mend")]
    Interrupted,
    /// There is no starting point.
    #[error(transparent)]
    Init(InitError),
    /// The solve has no solution.
    #[error(transparent)]
    Solve(SolveError),
    /// What is asked for does not exist. The field names it.
    #[error("{0}: not there; see when spba.h says that it is")]
    NotThere(&'static str),
    /// The threads cannot be started.
    #[error("threads: {0}; give fewer")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The library panicked. The field is the panic's message.
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
    /// The fault of the argument `what`.
    pub fn input(what: impl Into<String>, problem: impl Into<String>, mend: &'static str) -> Self {
        Self::Input {
            what: what.into(),
            problem: problem.into(),
            mend,
        }
    }

    /// The code that a host gets for this fault.
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
