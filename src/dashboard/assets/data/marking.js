// @ts-check
// Marking joins the parts of the page of a recording that have to do with marks: the lines of the quality report and
// the plots open the form, the form and the versions change the marks, and the plots shade them.

import { shadedSpans } from "../plot/math.js";
import { MarkForm } from "./mark_form.js";
import { draggedSpan } from "./marks.js";
import { MarksPart } from "./versions.js";

export class Marking {
  constructor(view, dataset) {
    this.dataset = dataset;
    this.chooser = null;
    this.samples = null;
    // The marks of the newest version, those in the form, and where a mark begins that has no end yet.
    this.marks = [];
    this.drafted = [];
    this.begun = null;
    this.form = new MarkForm(dataset, {
      store: (marks) => this.versions.add(marks),
      before: () => this.marks.length,
      changed: (marks) => this.shade({ drafted: marks }),
    });
    this.versions = new MarksPart(view, dataset, {
      changed: (marks) => this.shade({ marks }),
      show: (span, name) => this.show(span, name),
      begin: (place) => this.mark(place, { spans: [] }),
    });
    this.drags = {
      take: (part, name) => this.markPlot(draggedSpan(part, dataset), name),
      sample: (x, name) => this.markPlot({ from_s: x, to_s: x }, name),
      end: (side, x, name) => this.end(side, x, name),
    };
  }

  // The plots come after the parts that mark them.
  join(chooser, samples) {
    this.chooser = chooser;
    this.samples = samples;
    this.shade();
  }

  show = (span, name) => this.samples.show(span, name);

  mark = (place, marked) => this.form.open(place, marked);

  markPlot(span, name) {
    this.begun = null;
    this.mark(this.samples.chartOf(name).element, { spans: [span], name });
  }

  // A mark begins at an instant, or ends there; an end without a beginning marks a single sample.
  end(side, x, name) {
    if (side === 0) {
      this.begun = x;
      this.shade();
    } else {
      const ends = [this.begun ?? x, x];
      this.markPlot({ from_s: Math.min(...ends), to_s: Math.max(...ends) }, name);
    }
  }

  shade({ marks = this.marks, drafted = this.drafted } = {}) {
    this.marks = marks;
    this.drafted = drafted;
    const begun = this.begun === null ? [] : [{ from_s: this.begun, to_s: this.begun }];
    const spans = [...marks, ...drafted, ...begun];
    const isDrawn = ({ from_s, to_s }) => Number.isFinite(from_s) && Number.isFinite(to_s);
    this.chooser?.shade(shadedSpans(spans.filter(isDrawn), "marked"));
  }
}
