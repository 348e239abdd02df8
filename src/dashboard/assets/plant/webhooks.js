// @ts-check
// These pages show where events are delivered: the list of webhooks with a form for a new one, and a
// single webhook with what became of each delivery.

import { get, items, pause, send } from "../shell/api.js";
import { facts, h, notice, table } from "../shell/dom.js";
import { count, instant, instantText, words } from "../shell/format.js";
import { nameHeading, plantHead, readAsAdmin, stateBadge } from "./head.js";
import { pagedList } from "./paged.js";

const POLL_MS = 5000;
const WHAT = "The list of webhooks";

const EVENTS = [
  ["job.ended", "a job has ended"],
  ["monitor.alarm", "a monitor raises an alarm"],
];

const COLUMNS = [{ title: "Address" }, { title: "Events" }, { title: "Made" }];

const DELIVERY_COLUMNS = [
  { title: "Happened" },
  { title: "Event" },
  { title: "About" },
  { title: "State" },
  { title: "Again" },
  { title: "Attempts", numeric: true },
  { title: "Last answer" },
  { title: "Next attempt" },
  { title: "Delivered" },
];

export function showWebhooks(view) {
  const outcome = notice();
  const list = h("div", {});
  const content = h("div", { hidden: true });
  const read = async () => {
    try {
      const { data } = await get("/v1/webhooks", view.signal);
      content.hidden = false;
      list.replaceChildren(
        table("Webhooks", COLUMNS, items(data).map(webhookRow), { empty: "No webhooks yet.", stacked: true }),
      );
    } catch (error) {
      outcome.fail(error);
    }
  };
  content.append(webhookForm(read), h("h2", {}, "Webhooks of the project"), list);
  plantHead(view, "/plant/webhooks", "Webhooks");
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      "A webhook has events of the project delivered to an address, as Standard Webhooks says. ",
      h("a", { href: "/docs/running#where-events-go" }, "Where events may go"),
    ),
    outcome.place,
    content,
  );
  readAsAdmin({ view, what: WHAT, outcome, read });
}

function webhookRow({ id, url, events, created_at: created }) {
  return [h("a", { href: `#/plant/webhooks/${id}` }, url), events.join(", "), instant(created)];
}

function webhookForm(made) {
  const outcome = notice();
  const url = h("input", {
    type: "url",
    required: true,
    size: "44",
    placeholder: "https://mes.plant.example/greybox",
  });
  const boxes = EVENTS.map(([name, text]) => {
    const box = h("input", { type: "checkbox", name, checked: true });
    return { name, box, label: h("label", { class: "inline" }, box, `when ${text} (${name})`) };
  });
  const submit = async (event) => {
    event.preventDefault();
    const events = boxes.filter(({ box }) => box.checked).map(({ name }) => name);
    try {
      const { data } = await send("POST", "/v1/webhooks", { url: url.value.trim(), events });
      url.value = "";
      outcome.show(secretPanel(data));
      await made();
    } catch (error) {
      outcome.fail(error);
    }
  };
  return h(
    "form",
    { class: "panel", onsubmit: submit },
    h("div", { class: "fields" }, h("label", {}, "Address that events are sent to", url)),
    h(
      "div",
      { class: "choices" },
      boxes.map(({ label }) => [label, " "]),
    ),
    h("button", { type: "submit", class: "primary" }, "Make the webhook"),
    outcome.place,
  );
}

function secretPanel({ secret, url }) {
  const field = h("input", { type: "text", readonly: true, size: "44", value: secret, class: "secret" });
  field.addEventListener("focus", () => field.select());
  return h(
    "div",
    { class: "verdict high", role: "status" },
    h("p", {}, "Events go to ", h("code", { class: "digest" }, url), " from now on."),
    h("label", {}, "Secret that deliveries are signed with; it is shown this once", field),
  );
}

export function showWebhook(view, id) {
  const outcome = notice();
  const about = h("div", {});
  const content = h("div", { hidden: true });
  const resend = async (delivery) => {
    try {
      await send("POST", `/v1/deliveries/${delivery}/resend`);
      outcome.show(h("p", { role: "status" }, "The delivery is sent again."));
      await list.refresh();
    } catch (error) {
      outcome.fail(error);
    }
  };
  const remove = async () => {
    if (!confirm("Delete this webhook with its deliveries? Nothing more is sent there.")) {
      return;
    }
    try {
      await send("DELETE", `/v1/webhooks/${id}`);
      location.hash = "/plant/webhooks";
    } catch (error) {
      outcome.fail(error);
    }
  };
  const list = pagedList({
    view,
    address: `/v1/webhooks/${id}/deliveries`,
    more: "Older deliveries",
    failed: (error) => outcome.fail(error),
    recovered: () => outcome.clear(),
    draw: (rows) =>
      table(
        "Deliveries",
        DELIVERY_COLUMNS,
        rows.map((row) => deliveryRow(row, resend)),
        { empty: "Nothing was to be delivered yet.", stacked: true },
      ),
  });
  content.append(
    h(
      "div",
      { class: "actions" },
      h("button", { type: "button", class: "danger", onclick: remove }, "Delete this webhook"),
    ),
    about,
    h("h2", {}, "Deliveries"),
    list.element,
  );
  const heading = plantHead(view, "/plant/webhooks", id);
  view.root.append(outcome.place, content);
  const read = async () => {
    const { data } = await get(`/v1/webhooks/${id}`, view.signal);
    nameHeading(heading, data.url);
    about.replaceChildren(
      facts([
        ["Events", data.events.join(", ")],
        ["Made", instant(data.created_at)],
      ]),
    );
    content.hidden = false;
    await keepUp(view, list);
  };
  readAsAdmin({ view, what: WHAT, outcome, read });
}

async function keepUp(view, list) {
  for (;;) {
    await list.refresh();
    await pause(POLL_MS, view.signal);
  }
}

function deliveryRow(delivery, resend) {
  const { id, event, state, attempts, payload, last_status: status, last_error: error } = delivery;
  const label = `Resend the delivery of ${instantText(new Date(delivery.created_at), true)}`;
  return [
    instant(delivery.created_at),
    event,
    subject(payload.data ?? {}),
    stateBadge(state),
    h("button", { type: "button", class: "small", "aria-label": label, onclick: () => resend(id) }, "Resend"),
    count(attempts),
    h("span", { class: "sentence" }, [status ?? "", error].filter(Boolean).join(": ") || "–"),
    instant(delivery.next_attempt_at),
    instant(delivery.delivered_at),
  ];
}

// An alarm tells of its monitor, and the end of a job of its job.
function subject({ job, monitor, name, alarm }) {
  return monitor
    ? h("a", { href: `#/plant/monitors/${monitor}` }, words(alarm?.kind ?? monitor))
    : job
      ? h("a", { href: `#/jobs/${job}` }, name || job)
      : "–";
}
