"""Jobs, designs, selections and comparisons of a server that is killed."""

import json
import math
import time

from acknowledged import Kind, digest
from server import job

ENDED = ("succeeded", "failed", "cancelled")
# The states that a job may be shown in that goes on.
GOING_ON = {"queued", "running", "succeeded"}
# The states beside those before that a wish which was cut off may have led to.
CUT_WISH = {"cancel": {"running", "cancelled"}, "pause": {"running", "paused"}, "resume": GOING_ON}
WISHES = tuple(CUT_WISH)
WISHED = {"cancel": "cancelled", "pause": "paused", "resume": "resumed"}
# What of a result is the same for each job of one specification and seed.
SAME = ("parameters", "proposals", "inputs", "chosen", "with_chosen", "with_random", "with_all")
# How long a job may take to its end when nothing kills the server any more.
PATIENCE_S = 60
KEY = "idempotency-key"


def small_job(dataset, draw):
    """A job of some milliseconds, one of not too many different ones."""
    generations = draw.choice((2, 4, 8, 100, 400))
    spec = job(dataset, generations, draw.randrange(1, 6), refine=draw.random() < 0.25, further_searches=0)
    spec["parameters"].update(coulomb_friction={"value": 0}, offset={"value": 0})
    return {**spec, "process_noise": "none", "uncertainty": {"tried_steps": 0}}


class Work(Kind):
    """Work that is submitted with a key and is shown as a job."""

    path = "/v1/jobs"
    headers = {}
    # So many are unfinished, and so many are there, before others are made.
    most_unfinished, most = 5, 30
    # The share of submissions that are steered at once, while they have hardly begun.
    wishes_at_once = 0.25

    def __init__(self, plant):
        super().__init__(plant)
        self.kinds_of_results = {}

    def draw_body(self):
        """What is submitted, and the label by which a submission without a key is looked for."""
        raise NotImplementedError

    def act(self, client):
        unfinished = [thing for thing in self.things.values() if thing.status not in ENDED]
        draw = self.random.random()
        if len(unfinished) < self.most_unfinished and draw < 0.5:
            self.submit(client)
            if self.random.random() < self.wishes_at_once:
                self.wish(client, list(self.things.values())[-1])
        elif draw < 0.55 and self.things:
            self.submit_again(client, self.some())
        elif draw < 0.75 and unfinished:
            self.wish(client, self.random.choice(unfinished))
        elif draw < 0.85 and unfinished:
            self.look(client, self.random.choice(unfinished).path)
        elif len(self.things) > self.most or draw > 0.97:
            thing = self.some(lambda thing: thing.status in ENDED)
            if thing is not None:
                self.remove(client, thing)

    def submit(self, client):
        self.number += 1
        body, label = self.draw_body()
        key = None if label and self.random.random() < 0.15 else f"{self.name} {self.number}"
        self.pending = (key, body, label)
        self.send(client)

    def send(self, client):
        key, body, label = self.pending
        headers = {**self.headers, **({KEY: key} if key else {})}
        _, answer = self.call(client, "POST", self.path, body, headers, accept=(202,))
        self.pending = None
        self.count("made")
        self.acknowledge(answer, key, body)

    def acknowledge(self, answer, key, body):
        path = f"/v1/jobs/{answer['id']}"
        if path in self.things or path in self.gone_paths:
            self.fault("doubled", f"two submissions came to {path}")
        bare = {name: part for name, part in body.items() if name not in ("name", "labels")}
        self.keep(path, key=key, body=body, spec=answer["spec"], status=answer["status"], allowed=set(GOING_ON),
                  history=[answer["status"]], result=None, finished_at=None, sameness=json.dumps(bare, sort_keys=True))
        return path

    def settle(self, client):
        """Sends a submission that was cut off again where it has a key, and looks how many things it made."""
        key, body, label = self.pending
        listed = self.listed(client, label)
        if len(listed) > 1:
            self.fault("doubled", f"the submission {label} made {listed}")
        if key:
            self.send(client)
            made = list(self.things)[-1]
            if listed and made != f"/v1/jobs/{listed[0]}":
                self.fault("doubled", f"the key {key} made {listed[0]} before the kill and {made} after it")
        elif listed:
            _, shown = self.call(client, "GET", f"/v1/jobs/{listed[0]}", accept=(200,))
            self.acknowledge(shown, key, body)
        self.pending = None

    def listed(self, client, label):
        if not label:
            return []
        _, listed = self.call(client, "GET", f"/v1/jobs?view=summary&label=call:{label}", accept=(200,))
        return [item["id"] for item in listed["items"]]

    def submit_again(self, client, thing):
        """The same key and body come to the same job."""
        if not thing.key:
            return
        _, answer = self.call(client, "POST", self.path, thing.body, {**self.headers, KEY: thing.key}, accept=(202,))
        self.count("repeated")
        if f"/v1/jobs/{answer['id']}" != thing.path:
            self.fault("doubled", f"the key {thing.key} made {thing.path} and {answer['id']}")

    def wish(self, client, thing):
        """Cancels, pauses or resumes a job."""
        wishes = ("resume", "resume", "cancel") if thing.status == "paused" else ("cancel", "pause", "pause")
        word, before = self.random.choice(wishes), thing.allowed
        thing.allowed = before | CUT_WISH[word]
        thing.history.append(f"{word} asked")
        self.touch(thing.path)
        status, body = self.call(client, "POST", f"{thing.path}/{word}", accept=(200, 409))
        if status == 409:
            thing.allowed = before
            thing.history[-1] = f"{word} refused"
            self.look(client, thing.path)
            if thing.status not in ENDED and "cancelled" not in thing.allowed:
                self.fault("contradicted", f"{thing.path} refuses {word} ({body['detail']}) and is {thing.status}")
            return
        thing.history[-1] = f"{word} acknowledged, {body['status']}"
        at_work = {"running"} if body["status"] == "running" else set()
        asked = {"cancel": {"cancelled"} | at_work, "pause": {"paused"} | at_work, "resume": set(GOING_ON)}
        thing.allowed = asked[word]
        thing.status = body["status"]
        self.count(WISHED[word])

    def judge(self, client, thing, body):
        status = body["status"]
        if body["spec"] != thing.spec:
            self.fault("changed", f"{thing.path} was submitted with {thing.spec} and has now", body["spec"])
            thing.spec = body["spec"]
        if status not in thing.allowed:
            sort = "lost" if status == "failed" else "contradicted"
            self.fault(sort, f"{thing.path} after {thing.history} is now {status}", body["error"])
        if status == "paused" or status in ENDED:
            thing.allowed = {status}
        if status != thing.status:
            thing.history.append(f"shown {status}")
        thing.status = status
        if status in ENDED:
            self.judge_end(client, thing, body)

    def judge_end(self, client, thing, body):
        if thing.finished_at not in (None, body["finished_at"]):
            self.fault("changed", f"{thing.path} ended at {thing.finished_at} and now at", body["finished_at"])
        thing.finished_at = body["finished_at"]
        status, result = self.call(client, "GET", f"{thing.path}/result", accept=(200, 409))
        # A refusal has the number of its request in it.
        shown = (status, digest(client.text) if status == 200 else None)
        if thing.result is None:
            self.judge_events(client, thing)
            # A kill during the first look leaves the end as one that was not looked at.
            thing.result = shown
            self.plant.note_end(thing.path.rsplit("/", 1)[1], thing.status)
            self.count(f"ended {thing.status}")
            if thing.status == "succeeded":
                self.judge_same(thing, result)
        elif thing.result != shown:
            self.fault("changed", f"the result of {thing.path} was {thing.result} and is now {shown}", result)
            thing.result = shown

    def judge_same(self, thing, result):
        """Jobs of one specification and seed come to the same."""
        same = json.dumps({name: result[name] for name in SAME if name in result})
        path, before = self.kinds_of_results.setdefault(thing.sameness, (thing.path, same))
        if before != same:
            self.fault("changed", f"{thing.path} and {path} have one specification and come to {same} and", before)

    def judge_events(self, client, thing):
        self.call(client, "GET", f"{thing.path}/events", accept=(200,))
        lines = client.text.decode().splitlines()
        numbers = [int(line[4:]) for line in lines if line.startswith("id: ")]
        ends = lines.count("event: end")
        if numbers != list(range(1, len(numbers) + 1)) or ends != 1:
            self.fault("changed", f"the events of {thing.path} have the numbers {numbers} and {ends} ends")

    def check_all(self, client):
        """Lets all that is not ended come to its end, and looks at everything."""
        self.check(client)
        for thing in list(self.things.values()):
            self.look(client, thing.path)
            if thing.status == "paused":
                _, body = self.call(client, "POST", f"{thing.path}/resume", accept=(200,))
                thing.allowed, thing.status = set(GOING_ON), body["status"]
                thing.history.append("resume acknowledged at the end")
            until = time.monotonic() + PATIENCE_S
            while thing.path in self.things and thing.status not in ENDED and time.monotonic() < until:
                time.sleep(0.01)
                self.look(client, thing.path)
            if thing.status not in ENDED:
                self.fault("lost", f"{thing.path} after {thing.history} does not end")
        super().check_all(client)


class Jobs(Work):
    name = "jobs"

    def draw_body(self):
        label = f"{self.number}"
        body = small_job(self.random.choice(self.plant.datasets), self.random)
        return {**body, "name": f"job {label}", "labels": {"call": label}}, label


class Designs(Work):
    name, path, headers = "designs", "/v1/designs", {"prefer": "respond-async"}
    most_unfinished, most = 2, 10

    def draw_body(self):
        return {
            "model": "positioning_drive",
            "parameters": {"mass": {"estimate": {}, "prior": {"mean": 95, "std": 10}},
                           "viscous_friction": {"value": 200}, "coulomb_friction": {"value": 20},
                           "offset": {"value": 0}},
            "initial_state": {"position": 0, "velocity": 0},
            "outputs": {"position": {"noise_std": 1e-5}},
            "inputs": {"force": {"lower": -100, "upper": 100, "rate_per_s": 1e4}},
            "sample_time_s": 0.02, "duration_s": self.random.choice((0.5, 1, 2)), "wanted": ["mass"],
            "families": [self.random.choice(("steps", "prbs"))], "points": 1, "seed": self.random.randrange(1, 4),
        }, None


class Selections(Work):
    name, path = "selections", "/v1/selections"
    most_unfinished, most = 2, 10

    def draw_body(self):
        samples = self.random.choice((60, 120, 180))
        return {"job": self.plant.past_job, "stream": "line", "window_s": self.random.choice((20, 30, 60)),
                "wanted": ["time_constant"], "budget_samples": samples,
                "initial_state": {"lagged": {"estimate": {"lower": 0, "upper": 6}}}}, None


def history():
    """Six minutes of a lag of 5 s, as CSV; its input moves in the second and in the fifth of them."""
    text, state, minute = "time,u [-],y [-]\n", 2.0, 60
    for k in range(6 * minute):
        number, second = divmod(k, minute)
        value = 1.5 + 0.1 * number if number % 3 == 1 and second // 15 % 2 else 1.0
        measured = round((state + 0.01 * math.sin(k * 7.3)) * 100) / 100
        text += f"2026-03-02T08:{number:02}:{second:02}Z,{value},{measured}\n"
        state = 2 * value + math.exp(-0.2) * (state - 2 * value)
    return text


def past_job(client):
    """A finished job on a part of the stream `line`, from which selections go on."""
    assert client.ask("POST", "/v1/streams/line", history(), {"content-type": "text/csv"})[0] == 201
    part = {"from": "2026-03-02T08:00:00Z", "to": "2026-03-02T08:03:00Z"}
    status, cut, _ = client.ask("POST", "/v1/streams/line/recordings", part)
    assert status == 201, cut
    identifier = client.submit({
        "model": "first_order_dead_time",
        "experiments": [{"dataset": cut["id"], "initial_state": {"lagged": {"value": 2}}}],
        "parameters": {"gain": {"estimate": {"lower": 1, "upper": 4}}, "time_constant": {"estimate": {}},
                       "dead_time": {"value": 0}, "offset": {"value": 0}},
        "method": {"name": "multistart_lm", "population": 8, "generations": 2, "further_searches": 0},
        "process_noise": "none", "validation": {"fraction": 0}, "seed": 1})
    assert client.ended(identifier)["status"] == "succeeded"
    return identifier


class Comparisons(Kind):
    """Comparisons, each of two runs, which are deleted when both have ended."""

    name = "comparisons"
    most_unfinished, most = 2, 6

    def act(self, client):
        unfinished = [thing for thing in self.things.values() if not thing.final]
        draw = self.random.random()
        if len(unfinished) < self.most_unfinished and draw < 0.4:
            self.number += 1
            spec = small_job(self.plant.datasets[0], self.random)
            spec["method"].update(refine=False, generations=4)
            body = {"job": spec, "methods": ["icra_genetic", "cma_es"], "seeds": 1}
            self.pending = (f"comparison {self.number}", body)
            self.settle(client)
        elif draw < 0.5 and self.things:
            thing = self.some()
            _, answer = self.call(client, "POST", "/v1/comparisons", thing.body, {KEY: thing.key}, accept=(202,))
            if f"/v1/comparisons/{answer['id']}" != thing.path:
                self.fault("doubled", f"the key {thing.key} made {thing.path} and {answer['id']}")
        elif draw < 0.8 and unfinished:
            self.look(client, self.random.choice(unfinished).path)
        elif len(self.things) > self.most or draw > 0.95:
            thing = self.some(lambda thing: thing.final)
            if thing is not None:
                self.remove_run(client, thing)

    def settle(self, client):
        key, body = self.pending
        _, answer = self.call(client, "POST", "/v1/comparisons", body, {KEY: key}, accept=(202,))
        self.pending = None
        self.count("made")
        path = f"/v1/comparisons/{answer['id']}"
        if path in self.things or path in self.gone_paths:
            self.fault("doubled", f"two submissions came to {path}")
        runs = [(run["id"], run["method"], run["seed"]) for run in answer["jobs"]]
        if len(runs) != 2:
            self.fault("lost", f"{path} has not two runs", runs)
        self.keep(path, key=key, body=body, runs=runs, final=None, ends={}, cut_run=None,
                  is_counted=False)

    def judge(self, client, thing, body):
        runs = [(run["id"], run["method"], run["seed"]) for run in body["jobs"]]
        if thing.cut_run:
            # The removal of a run that was cut off has happened or not.
            if thing.cut_run not in runs:
                thing.runs = [run for run in thing.runs if run != thing.cut_run]
                self.plant.runs_gone.append(thing.cut_run[0])
                thing.final = digest(client.text)
            thing.cut_run = None
        if runs != thing.runs:
            self.fault("changed", f"{thing.path} had the runs {thing.runs} and has now", runs)
            thing.runs = runs
        for run in body["jobs"]:
            if thing.ends.get(run["id"], run["status"]) != run["status"]:
                self.fault("contradicted", f"{run['id']} was {thing.ends[run['id']]} and is now {run['status']}")
            if run["status"] in ENDED:
                thing.ends[run["id"]] = run["status"]
                self.plant.note_end(run["id"], run["status"])
            if run["status"] in ("failed", "cancelled"):
                self.fault("lost", f"the run {run['id']} of {thing.path} is {run['status']}")
        if not body["finished"]:
            return
        shown = digest(client.text)
        if not thing.is_counted:
            thing.is_counted = True
            self.count("finished")
        if thing.final not in (None, shown):
            self.fault("changed", f"{thing.path} had finished and is now", body)
        thing.final = shown

    def remove_run(self, client, thing):
        """Deletes one run of a finished comparison; with the last one the comparison is gone."""
        run = self.random.choice(thing.runs)
        thing.cut_run, thing.is_leaving = run, len(thing.runs) == 1
        self.touch(thing.path)
        self.call(client, "DELETE", f"/v1/jobs/{run[0]}", accept=(204,))
        self.count("runs deleted")
        self.plant.runs_gone.append(run[0])
        thing.runs, thing.cut_run = [left for left in thing.runs if left != run], None
        if not thing.runs:
            self.count("deleted")
            self.forget(thing)
            return
        # What is left of a comparison is summed up anew.
        thing.final = None
        self.look(client, thing.path)

    def check_all(self, client):
        self.check(client)
        until = time.monotonic() + PATIENCE_S
        while any(thing.final is None for thing in self.things.values()) and time.monotonic() < until:
            time.sleep(0.01)
            for thing in list(self.things.values()):
                self.look(client, thing.path)
        for thing in self.things.values():
            if thing.final is None:
                self.fault("lost", f"{thing.path} does not finish")
        super().check_all(client)
