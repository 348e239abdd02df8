//! The draws from a posterior in a report: a table of how well the chains have converged, and a corner
//! plot of the draws.

use super::html::{escape, number, push};
use crate::identification::outcome::{Outcome, PosteriorDraws, PosteriorReport};
use greybox_numerics::digits::significant;
use greybox_numerics::statistics;

/// Unknowns of a corner plot at the most.
const MOST_UNKNOWNS: usize = 6;
/// Draws in each panel at the most.
const MOST_DOTS: usize = 300;
/// Bars of a histogram.
const BARS: usize = 20;
/// The width and the height of a panel, and the gap to the next one.
const PANEL: f64 = 130.0;
const GAP: f64 = 8.0;
/// The room for labels along the left and along the bottom.
const MARGIN: f64 = 34.0;
/// A panel shows this share of the draws in each direction: a single draw far out would hide the rest.
const SHOWN: [f64; 2] = [0.002, 0.998];

/// The table and the plot; nothing where no draws were asked for.
pub fn section(page: &mut String, outcome: &Outcome) {
    let Some(draws) = &outcome.posterior else {
        return;
    };
    push(
        page,
        format_args!(
            "<section>\n<h2>Draws from the posterior</h2>\n<p class=\"muted\">Chains of {} generations. The draws \
             themselves: <code>/v1/jobs/{}/posterior</code>, as JSON or CSV.</p>\n<div class=\"scroll\"><table>\n\
             <thead><tr><th>unknown</th><th>mean</th><th>standard deviation</th><th>2.5 %</th><th>50 %</th>\
             <th>97.5 %</th><th>R̂</th><th>effective draws, middle</th><th>tails</th></tr></thead>\n",
            draws.generations,
            escape(&outcome.job)
        ),
    );
    for (name, posterior) in described(outcome) {
        page.push_str("<tr>");
        push(page, format_args!("<td>{}</td>", escape(&name)));
        for cell in cells(posterior) {
            push(page, format_args!("<td>{cell}</td>"));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n");
    corner(page, draws);
    page.push_str("</section>\n");
}

/// The table in Markdown; nothing where no draws were asked for.
pub fn markdown(text: &mut String, outcome: &Outcome) {
    if outcome.posterior.is_none() {
        return;
    }
    text.push_str(
        "\n## Draws from the posterior\n\n| unknown | mean | standard deviation | 2.5 % | 50 % | 97.5 % | R̂ | \
         effective draws, middle | tails |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for (name, posterior) in described(outcome) {
        let cells = cells(posterior).join(" | ");
        push(
            text,
            format_args!("| {} | {cells} |\n", name.replace('|', "\\|")),
        );
    }
}

/// The unknowns that have draws, by the names that the table of the estimates has.
fn described(outcome: &Outcome) -> Vec<(String, &PosteriorReport)> {
    let parameters = outcome.parameters.iter();
    let parameters = parameters.map(|parameter| (parameter.label(), &parameter.estimate));
    let states = outcome.initial_states.iter();
    let states = states.map(|state| (state.label(), &state.estimate));
    let all = parameters.chain(states);
    all.filter_map(|(name, estimate)| Some((name, estimate.posterior.as_ref()?)))
        .collect()
}

fn cells(posterior: &PosteriorReport) -> Vec<String> {
    let digits = |value: Option<f64>, digits| {
        value.map_or_else(|| "–".to_owned(), |value| significant(value, digits))
    };
    let mut cells = vec![
        number(posterior.mean),
        significant(posterior.standard_deviation, 3),
    ];
    let quantiles = posterior.quantiles.iter();
    cells.extend(quantiles.map(|quantile| number(quantile.value)));
    cells.extend([
        digits(posterior.r_hat, 4),
        digits(posterior.ess_bulk, 3),
        digits(posterior.ess_tail, 3),
    ]);
    cells
}

/// One unknown of a corner plot.
struct CornerColumn {
    values: Vec<f64>,
    low: f64,
    high: f64,
    label: String,
}

impl CornerColumn {
    /// None where all draws are one number.
    fn of(draws: &PosteriorDraws, index: usize) -> Option<CornerColumn> {
        let values: Vec<f64> = draws.rows.iter().map(|row| row[index]).collect();
        let [low, high] = SHOWN.map(|share| statistics::quantile(&values, share));
        let (low, high) = (low?, high?);
        (low < high).then(|| CornerColumn {
            values,
            low,
            high,
            label: format!("{} [{}]", draws.names[index], draws.units[index]),
        })
    }

    /// Where a value is within a panel, 0 to 1; none where the panel does not show it.
    fn place(&self, value: f64) -> Option<f64> {
        let place = (value - self.low) / (self.high - self.low);
        (0.0..=1.0).contains(&place).then_some(place)
    }
}

/// Where the upper left corner of a panel is.
#[derive(Clone, Copy)]
struct PanelCorner {
    x: f64,
    y: f64,
}

impl PanelCorner {
    /// The panel of this column and row, both counted from the upper left one.
    fn of(column: usize, row: usize) -> PanelCorner {
        let at = |place: usize| place as f64 * (PANEL + GAP);
        PanelCorner {
            x: MARGIN + at(column),
            y: at(row) + GAP,
        }
    }
}

/// Each unknown over each other one, and how often it has which value.
fn corner(page: &mut String, draws: &PosteriorDraws) {
    let unknowns = 0..draws.names.len().min(MOST_UNKNOWNS);
    let columns: Vec<CornerColumn> = unknowns
        .filter_map(|index| CornerColumn::of(draws, index))
        .collect();
    if columns.is_empty() {
        return;
    }
    let size = MARGIN + columns.len() as f64 * (PANEL + GAP) + MARGIN;
    push(
        page,
        format_args!(
            "<figure>\n<svg viewBox=\"0 0 {size:.0} {size:.0}\" style=\"max-width: {size:.0}px\" role=\"img\" \
             aria-label=\"Draws from the posterior, each unknown over each other one\">\n"
        ),
    );
    for (row, up) in columns.iter().enumerate() {
        for (place, across) in columns.iter().enumerate().take(row) {
            dots(page, [across, up], PanelCorner::of(place, row));
        }
        histogram(page, up, PanelCorner::of(row, row));
        labels(page, up, row, columns.len());
    }
    let first = match draws.names.len() > MOST_UNKNOWNS {
        true => format!("the first {MOST_UNKNOWNS} unknowns, "),
        false => String::new(),
    };
    push(
        page,
        format_args!(
            "</svg>\n<figcaption>Draws from the posterior: {first}each over each other one, and how often each has \
             which value.</figcaption>\n</figure>\n"
        ),
    );
}

fn frame(page: &mut String, at: PanelCorner) {
    let PanelCorner { x, y } = at;
    push(
        page,
        format_args!("<path class=\"axis\" d=\"M{x:.1} {y:.1}h{PANEL}v{PANEL}h-{PANEL}z\"/>\n"),
    );
}

fn dots(page: &mut String, [across, up]: [&CornerColumn; 2], at: PanelCorner) {
    let PanelCorner { x, y } = at;
    frame(page, at);
    let every = across.values.len().div_ceil(MOST_DOTS);
    let pairs = across.values.iter().zip(&up.values).step_by(every.max(1));
    let mut path = String::new();
    for (along, above) in pairs {
        if let (Some(along), Some(above)) = (across.place(*along), up.place(*above)) {
            let (along, above) = (x + along * PANEL, y + (1.0 - above) * PANEL);
            push(&mut path, format_args!("M{along:.1} {above:.1}h0"));
        }
    }
    push(
        page,
        format_args!(
            "<path fill=\"none\" stroke=\"#2b6cb0\" stroke-opacity=\"0.5\" stroke-width=\"2.4\" \
             stroke-linecap=\"round\" d=\"{path}\"/>\n"
        ),
    );
}

fn histogram(page: &mut String, column: &CornerColumn, at: PanelCorner) {
    let PanelCorner { x, y } = at;
    frame(page, at);
    let mut counts = [0_usize; BARS];
    for place in column
        .values
        .iter()
        .filter_map(|value| column.place(*value))
    {
        counts[((place * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(1).max(1);
    let width = PANEL / BARS as f64;
    let mut path = String::new();
    for (bar, count) in counts.iter().enumerate() {
        let height = 0.95 * PANEL * *count as f64 / most as f64;
        let (left, top) = (x + bar as f64 * width, y + PANEL - height);
        push(
            &mut path,
            format_args!("M{left:.1} {top:.1}h{width:.1}v{height:.1}h-{width:.1}z"),
        );
    }
    push(
        page,
        format_args!("<path fill=\"#2b6cb0\" d=\"{path}\"/>\n"),
    );
}

/// The label of an unknown along the bottom and, where it stands above others, along the left.
fn labels(page: &mut String, column: &CornerColumn, place: usize, n: usize) {
    let PanelCorner { x, y } = PanelCorner::of(place, n - 1);
    let (middle, below) = (x + 0.5 * PANEL, y + PANEL + 14.0);
    push(
        page,
        format_args!(
            "<text class=\"tick\" x=\"{x:.1}\" y=\"{below:.1}\">{}</text><text class=\"tick\" \
             text-anchor=\"end\" x=\"{:.1}\" y=\"{below:.1}\">{}</text><text class=\"tick\" \
             text-anchor=\"middle\" x=\"{middle:.1}\" y=\"{:.1}\">{}</text>\n",
            significant(column.low, 3),
            x + PANEL,
            significant(column.high, 3),
            below + 14.0,
            escape(&column.label)
        ),
    );
    if place > 0 {
        let panel = PanelCorner::of(0, place);
        let (x, y) = (MARGIN - 12.0, panel.y + 0.5 * PANEL);
        push(
            page,
            format_args!(
                "<text class=\"tick\" text-anchor=\"middle\" transform=\"translate({x:.1} {y:.1}) rotate(-90)\">{}\
                 </text>\n",
                escape(&column.label)
            ),
        );
    }
}
