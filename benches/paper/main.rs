//! The paper's search, unabridged: its Figures 4 and 7 on demonstration recording A.
//!
//! `cargo bench --bench paper` searches twice, with and without elitism, with the paper's numbers
//! (section 4: 30 candidates, 1000 generations, credit gain 15, crossover 0.8, mutation 0.01,
//! 12 000 samples), without what this project adds to it (hill climbing, refinement, the stop on
//! stagnation). It writes `benches/figures/best_credit.svg` and `squared_error.svg`, the rows
//! behind them as CSV, and prints what the paper states in words.

use greybox::Identification;
use greybox::demo::{self, Demo, sensors};
use greybox::estimation::{Estimation, GenerationRow, Observer, Problem, Settings};
use greybox::report::chart::{Chart, Series};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Where the figures go.
const FIGURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/figures");

/// The seed of the recording and of the search.
const SEED: u64 = 1;

/// The names of the two curves.
const WITH: &str = "with elitism";
const WITHOUT: &str = "without elitism";
/// An orange and a blue that the colour-blind can tell apart (M. Okabe, K. Ito, 2008).
const COLOURS: [&str; 2] = ["#e69f00", "#0072b2"];

fn main() -> std::io::Result<()> {
    let problem = problem();
    let searches = [(WITH, true), (WITHOUT, false)].map(|(name, elitism)| {
        let started = Instant::now();
        let rows = search(&problem, elitism);
        let seconds = started.elapsed().as_secs_f64();
        println!("{name}: {}, in {seconds:.0} s", in_words(&rows));
        (name, rows)
    });
    std::fs::create_dir_all(FIGURES)?;
    let folder = Path::new(FIGURES);
    std::fs::write(
        folder.join("best_credit.svg"),
        best_credit(&searches).file(),
    )?;
    std::fs::write(
        folder.join("squared_error.svg"),
        squared_error(&searches).file(),
    )?;
    std::fs::write(folder.join("paper.csv"), table(&searches))?;
    println!("figures in benches/figures");
    Ok(())
}

/// The job of the demonstration, over all of its data.
fn problem() -> Problem {
    let job = Identification::of_job(demo::job(Demo::A), demo::recording(Demo::A, SEED));
    job.hold_back(0.0)
        .problem()
        .expect("the demonstration's recording belongs to its job")
}

/// The settings of the paper; what it leaves open has the program's defaults.
fn settings(elitism: bool) -> Settings {
    Settings {
        population: 30,
        generations: 1000,
        credit_gain: 15.0,
        crossover_probability: 0.8,
        mutation_probability: 0.01,
        elitism,
        hill_climbing_interval: 0,
        stagnation_generations: 0,
        refine: false,
        ..Settings::default()
    }
}

/// Keeps every row.
struct Rows(Vec<GenerationRow>);

impl Observer for Rows {
    fn generation(&mut self, row: &GenerationRow) {
        self.0.push(row.clone());
    }
}

fn search(problem: &Problem, elitism: bool) -> Vec<GenerationRow> {
    let mut rows = Rows(Vec::new());
    let never = AtomicBool::new(false);
    Estimation::start(problem, &settings(elitism), SEED).run(problem, &never, &mut rows);
    rows.0
}

/// The sum of the squared errors of the generation's best candidate [mm²].
fn square_millimetres(row: &GenerationRow) -> f64 {
    let noise = 1e3 * sensors::POSITION_NOISE;
    row.generation_best_cost * noise * noise * demo::SAMPLES as f64
}

fn in_words(rows: &[GenerationRow]) -> String {
    let Some(last) = rows.last() else {
        return "nothing was searched".to_owned();
    };
    let best = rows.iter().map(|row| row.best_credit).fold(0.0, f64::max);
    let updates = rows
        .iter()
        .map(|row| f64::from(row.credit_updates))
        .sum::<f64>();
    let near = |row: &&GenerationRow| row.best_cost <= 1.05 * last.best_cost;
    let parameters = last
        .best
        .iter()
        .map(|(name, value)| format!("{name} {value:.5e}"));
    format!(
        "best credit {best:.3}, {:.0} credit updates a generation, within 5 % of the last cost {:.4} from \
         generation {}, {}",
        updates / rows.len() as f64,
        last.best_cost,
        rows.iter().find(near).map_or(0, |row| row.generation),
        parameters.collect::<Vec<_>>().join(", ")
    )
}

type Searches = [(&'static str, Vec<GenerationRow>); 2];

/// The paper's Figure 4.
fn best_credit(searches: &Searches) -> Chart<'static> {
    chart("best credit", searches, |row| row.best_credit)
}

/// The paper's Figure 7, of each generation's best candidate.
fn squared_error(searches: &Searches) -> Chart<'static> {
    let label = "log10 of the squared error [mm²]";
    chart(label, searches, |row| square_millimetres(row).log10())
}

fn chart(
    y_label: &'static str,
    searches: &Searches,
    value: impl Fn(&GenerationRow) -> f64,
) -> Chart<'static> {
    let series = |((name, rows), colour): (&(&'static str, Vec<GenerationRow>), _)| Series {
        name,
        colour,
        points: rows
            .iter()
            .map(|row| (f64::from(row.generation), value(row)))
            .collect(),
        ..Series::default()
    };
    // The line without elitism moves more and is drawn first.
    Chart {
        x_label: "generation",
        y_label,
        series: searches.iter().rev().zip(COLOURS).map(series).collect(),
        ..Chart::default()
    }
}

fn table(searches: &Searches) -> String {
    let mut text = "search,generation,best_credit,squared_error [mm^2],credit_updates\n".to_owned();
    for (name, rows) in searches {
        for row in rows {
            text += &format!(
                "{name},{},{},{},{}\n",
                row.generation,
                row.best_credit,
                square_millimetres(row),
                row.credit_updates
            );
        }
    }
    text
}
