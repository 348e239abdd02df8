// An operator of the service watches a plant whose mass changes, finds a job among all that the server has, cancels a
// night's work, and makes and ends a token. The plant is simulated and fed as a collector would feed it.

import { execFileSync } from "node:child_process";
import { performance } from "node:perf_hooks";
import { PATIENCE } from "./browser.mjs";
import { csv, feed, WINDOW_S, windowOf } from "./feeding.mjs";
import { Person } from "./person.mjs";
import { verdictOn } from "./roles_engineer.mjs";
import { base, ended, JOB, ownServer, post } from "./server.mjs";

const { GREYBOX_PROGRAM: program } = process.env;
const [BEFORE, AFTER] = [10, 8];
const LONG_JOBS = 40;
const RUN = Date.now().toString(36);
const STREAM = `press-${RUN}`;

async function watched(person) {
  const { page } = person;
  const { id: dataset } = await post(
    `/v1/datasets?name=${STREAM}`,
    csv("time [s]", await windowOf(95, 99)),
    "text/csv",
  );
  const job = await post("/v1/jobs", { ...JOB(dataset, "cma_es"), name: `press, as commissioned ${RUN}` });
  await ended(job.id);
  await feed(STREAM, { first: 0, count: BEFORE, mass: 95 });
  await person.step("the stream found", async () => {
    await person.press("Plant", "Pages");
    await person.press("Streams", "Plant");
    await person.press(STREAM);
    await person.sees("Signals in this part");
  });
  await person.step("a monitor set up and started", async () => {
    await person.press("Watch it with a monitor");
    await person.choose("Job to do", `as commissioned ${RUN}`);
    await person.sees("measured output");
    await person.type("Name of the monitor", `press ${RUN}`);
    await person.type("Length of a window", String(WINDOW_S));
    await person.press("Start to watch");
    await page.waitForFunction(() => location.hash.startsWith("#/plant/monitors/mon_"), PATIENCE);
  });
  await person.step(`${BEFORE - 1} windows worked`, () =>
    person.sees(`Waits for window ${BEFORE - 1}`, { timeout: 300_000 }),
  );
  await feed(STREAM, { first: BEFORE, count: AFTER, mass: 120 });
  await person.step("the alarm seen, after a mass of 95 kg became 120 kg", () =>
    page.waitForSelector("[aria-label='Alarms'] tbody tr", { timeout: 300_000 }),
  );
  console.log(
    `    ${await page.$eval("[aria-label='Alarms'] tbody", (rows) => rows.innerText.replace(/\s+/g, " "))}`,
  );
  await person.step("from the alarm to the job of its window", async () => {
    await person.press("job", "Alarms");
    const { grade, parameters } = await verdictOn(page);
    console.log(`    ${grade} ${parameters[0]}`);
  });
}

async function list(person) {
  const { page } = person;
  const [first] = (await (await fetch(`${base}/v1/jobs?view=summary&limit=500`)).json()).items.slice(-1);
  await fetch(`${base}/v1/jobs/${first.id}`, {
    method: "PATCH",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ labels: { order: `WO-${RUN}` } }),
  });
  const { id: dataset } = await post(
    `/v1/datasets?name=${STREAM}-long`,
    csv("time [s]", await windowOf(95, 98)),
    "text/csv",
  );
  const method = { name: "icra_genetic", population: 60, generations: 100_000, stagnation_generations: 0 };
  for (let k = 0; k < LONG_JOBS; k += 1) {
    const spec = {
      ...JOB(dataset, "cma_es"),
      name: `night ${RUN} ${k}`,
      labels: { batch: `night-${RUN}` },
      method,
    };
    await post("/v1/jobs", spec);
  }
  await person.step("the list opened, until its rows can be used", async () => {
    const from = performance.now();
    await person.press("Jobs", "Pages");
    await page.waitForFunction(
      () => document.querySelectorAll("tbody a[href^='#/jobs/job_']").length > 10,
      PATIENCE,
    );
    const used = performance.now() - from;
    await page.waitForFunction(
      () => /\d jobs$/.test(document.querySelector("main > p[role=status]")?.innerText),
      PATIENCE,
    );
    const all = await page.$eval("main > p[role=status]", ({ innerText }) => innerText);
    console.log(
      `    rows after ${used.toFixed(0)} ms, ${all} after ${(performance.now() - from).toFixed(0)} ms`,
    );
  });
  await person.step("one job found by its label", async () => {
    await person.type("Search", `WO-${RUN}`);
    await page.waitForFunction(
      () => /^1 of .* jobs$/.test(document.querySelector("main > p[role=status]").innerText),
      PATIENCE,
    );
    await page.waitForFunction(
      () => document.querySelectorAll("tbody a[href^='#/jobs/job_']").length === 1,
      PATIENCE,
    );
  });
  await person.step(`${LONG_JOBS} jobs cancelled at once`, async () => {
    await person.type("Search", `night-${RUN}`);
    await person.press("Select all jobs that the list shows");
    await person.press(`Cancel ${LONG_JOBS}`);
    await person.sees(`${LONG_JOBS} of ${LONG_JOBS} jobs are cancelled.`);
  });
}

// The server is one of its own, since a server asks everybody for a token from the first one on.
async function tokens(person) {
  if (!program) {
    console.log("  tokens left out: GREYBOX_PROGRAM names no program");
    return;
  }
  const server = await ownServer(program);
  const run = (command) => {
    person.did.keys += "greybox ".length + command.length + 1;
    const words = [...command.split(" "), "--database", server.database];
    return execFileSync(program, words, { stdio: ["ignore", "pipe", "ignore"] }).toString();
  };
  try {
    await signedIn(person, server.address, run);
  } finally {
    await server.stop();
  }
}

async function signedIn(person, address, run) {
  const { page } = person;
  await page.goto(`${address}/#/plant/access`);
  await person.sees("This server asks nobody who they are");
  const secret = await person.step("a token made, by the command that the page names", async () => {
    const [made] = /gbx_[0-9a-f]+/.exec(run("token create --name shift --scope admin"));
    return made;
  });
  await person.step("signed in with it", async () => {
    // The server may take a second to ask for tokens.
    do {
      person.did.keys += 1;
      await page.reload();
      await page.waitForFunction(
        () => /You are|Sign in/.test(document.querySelector("main").innerText),
        PATIENCE,
      );
    } while (!(await person.isOffered("Sign in")));
    const field = await page.waitForSelector("form.sign-in input", PATIENCE);
    await person.click(field);
    // A person pastes the secret.
    person.did.keys += 1;
    await page.keyboard.sendCharacter(secret);
    await person.key("Enter");
    await person.sees("You are");
  });
  await person.step("the token ended, and the page asks again", async () => {
    run("token revoke shift");
    await person.press("Jobs", "Pages");
    await person.sees("Sign in");
  });
  console.log(
    `    the page says: ${await page.$eval("main", (main) => main.innerText.replace(/\s+/g, " ").slice(0, 400))}`,
  );
}

export async function operator(hands) {
  const person = await Person.at("/#/", hands);
  for (const act of [watched, list, tokens]) {
    await act(person);
  }
  return person;
}
