use super::*;
use crate::solver::{Evaluation, Interpolation, LinearSolver, Minimiser, SolverOptions, Strategy};

fn parse(text: &str) -> Result<MinimiserSettings, String> {
    let parsed = MinimiserSettings::parse(text, Path::new("a.toml"));
    parsed.map_err(|error| error.to_string())
}

#[test]
fn what_ships_is_both_minimisers_with_both_strategies_on_the_defaults() {
    let shipped = MinimiserSettings::shipped().unwrap();
    assert_eq!(shipped.perturbation, Perturbation::default());
    let lm = Minimiser::lm(LinearSolver::Auto);
    let lbfgs = Minimiser::Lbfgs {
        rank: 20,
        interpolation: Interpolation::Cubic,
    };
    let expected = [
        ("lm-joint", lm, Strategy::Joint),
        ("lm-alternating", lm, Strategy::Alternating),
        ("lbfgs-joint", lbfgs, Strategy::Joint),
        ("lbfgs-alternating", lbfgs, Strategy::Alternating),
    ];
    assert_eq!(shipped.methods.len(), expected.len());
    for (method, (name, minimiser, strategy)) in shipped.methods.iter().zip(expected) {
        let config = Config {
            solver: SolverOptions {
                minimiser,
                strategy,
                free_form: FreeForm::None,
                ..SolverOptions::default()
            },
            ..Config::default()
        };
        assert_eq!(
            (method.name.as_str(), method.label.as_str(), &method.config),
            (name, name, &config)
        );
    }
    // What stands there as a comment can be used, too.
    let (_, commented) = DEFAULT.split_once("# [[minimisers]]\n").unwrap();
    let text = format!("schema = 1\n[[minimisers]]\n{}", commented.replace("# ", ""));
    let solver = &parse(&text).unwrap().methods[0].config.solver;
    assert_eq!(solver.evaluation, Evaluation::Blocks);
}

#[test]
fn a_minimisers_keys_are_laid_over_the_common_ones() {
    let settings = parse(
        "schema = 1\nprior = \"chair\"\ninit.points = 500\nobjective.style_weight = 7.0\n\
         solver = { max_steps = 3, minimiser = { method = \"lbfgs\", rank = 5 } }\n\
         [[minimisers]]\nname = \"own\"\nminimiser.rank = 9\nmax_steps = 4\n\
         [[minimisers]]\nname = \"other\"\nminimiser.method = \"lm\"\nstrategy = \"alternating\"\n",
    )
    .unwrap();
    assert_eq!((settings.prior.as_str(), settings.init.points), ("chair", 500));
    let [own, other] = &settings.methods[..] else {
        panic!("{:?}", settings.methods);
    };
    for method in [own, other] {
        assert_eq!(method.config.objective.style_weight, 7.0, "{}", method.name);
        assert_eq!(method.config.prior, "chair");
    }
    assert_eq!(own.config.solver.minimiser, Minimiser::lbfgs(9));
    assert_eq!(other.config.solver.minimiser, Minimiser::lm(LinearSolver::Auto));
    assert_eq!(
        (own.config.solver.max_steps, other.config.solver.max_steps),
        (4, 3)
    );
}

#[test]
fn what_cannot_be_used_is_named_with_its_place() {
    let one = "[[minimisers]]\nname = \"a\"\n";
    for (text, words) in [
        ("schema = 1\n".to_owned(), "missing field `minimisers`"),
        (
            "schema = 1\nminimisers = []\n".to_owned(),
            "minimisers: there is none",
        ),
        (format!("schema = 2\n{one}"), "schema: 1 expected, found 2"),
        (
            format!("schema = 1\nobjectives = 1\n{one}"),
            "unknown field `objectives`",
        ),
        (
            format!("schema = 1\n{one}{one}"),
            "minimisers[1] `a`: name: there is one",
        ),
        (
            "schema = 1\n[[minimisers]]\nname = \"a/b\"\n".to_owned(),
            "minimisers[0] `a/b`: name: must be of letters",
        ),
        (
            "schema = 1\n[[minimisers]]\nstrategy = \"joint\"\n".to_owned(),
            "minimisers[0]: missing field `name`",
        ),
        (
            format!("schema = 1\n{one}iterations = 5\n"),
            "minimisers[0] `a`: iterations: unknown field `iterations`",
        ),
        (
            format!("schema = 1\n{one}strategy = \"both\"\n"),
            "minimisers[0] `a`: strategy: unknown variant `both`",
        ),
        (
            format!("schema = 1\n{one}minimiser = {{ method = \"lbfgs\", rank = 0 }}\n"),
            "minimisers[0] `a`: rank: must be 1 or more",
        ),
        (
            format!("schema = 1\n{one}free_form = \"any\"\n"),
            "minimisers[0] `a`: free_form: minimisers are compared",
        ),
        (
            format!("schema = 1\nobjective.style_weight = -1.0\n{one}"),
            "a.toml: objective.style_weight: must be",
        ),
        (
            format!("schema = 1\nsolver.levels = 9\n{one}"),
            "a.toml: solver.levels: must be 1 to 8",
        ),
        (
            format!("schema = 1\nperturbation.rotation = 3\n{one}"),
            "perturbation",
        ),
        (
            format!("schema = 1\nperturbation = {{ rotation_deg = 0, share_of_distance = 0 }}\n{one}"),
            "perturbation: one of rotation_deg and share_of_distance",
        ),
        (
            format!("schema = 1\nperturbation.rotation_deg = nan\n{one}"),
            "perturbation.rotation_deg: must be 0 to 180",
        ),
        ("schema = ".to_owned(), "a.toml: "),
    ] {
        let message = parse(&text).unwrap_err();
        assert!(message.contains(words), "`{words}` is not in: {message}");
        assert!(
            message.starts_with("a.toml: ") && message.ends_with(MEND),
            "{message}"
        );
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}
