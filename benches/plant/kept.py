"""What is kept: backups of a server at work, damaged files, what jobs were predicted to cost, memory."""

import contextlib
import http.client
import os
import random
import shutil
import sqlite3
import tempfile
import threading
import time

from regular import small_job
from server import Client, Server, job, percentile


def backup(options):
    """Backups while jobs come, each restored and looked at."""
    rounds, missing, other_bits, unsound = options.count or 20, 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder)
        server.start()
        client = server.client()
        dataset, going, acknowledged, results = client.store(150), True, [], {}

        def submits():
            own, seed = server.client(), 0
            while going:
                seed += 1
                accepted = own.submit(job(dataset, 3, seed))
                acknowledged.extend([accepted] if accepted else [])
                time.sleep(0.05)

        thread = threading.Thread(target=submits)
        thread.start()
        took, checked = [], 0
        for turn in range(rounds):
            time.sleep(random.uniform(0.2, 1))
            before = list(acknowledged)
            for own in random.sample(before, min(5, len(before))):
                status, body, _ = client.ask("GET", f"/v1/jobs/{own}/result")
                results.update({own: body["parameters"]} if status == 200 else {})
            copy, began = os.path.join(folder, f"copy{turn}.db"), time.monotonic()
            status, said = server.command("backup", copy)
            took.append(time.monotonic() - began)
            unsound += status != 0
            restored = Server(options, folder, database=f"restored{turn}.db")
            unsound += restored.command("restore", copy)[0] != 0
            unsound += restored.command("check")[0] != 0
            restored.start()
            again = restored.client()
            missing += sum(again.show(own) is None for own in before)
            for own, parameters in results.items():
                status, body, _ = again.ask("GET", f"/v1/jobs/{own}/result")
                if own in before:
                    checked += 1
                    other_bits += status != 200 or body["parameters"] != parameters
            restored.kill()
        going = False
        thread.join()
        server.kill()
    print(f"backup: {rounds} under load ({max(took):.2f} s at the most), each restored, checked and served; of "
          f"{len(acknowledged)} acknowledged jobs {missing} missing, of {checked} results {other_bits} with other bits, "
          f"{unsound} commands failed")
    return not (missing or other_bits or unsound)


def damage(options):
    """A file with random bytes in it, a log that is cut, a schema that is another."""
    trials, random_ = options.count or 60, random.Random(1)
    told = {"at start": 0, "by check": 0, "by neither, same answers": 0, "an earlier state": 0, "MISSING": 0, "FAILED when asked for": 0, "WRONG": 0}
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder)
        server.start()
        client = server.client()
        dataset = client.store(400)
        jobs = [client.submit(job(dataset, 5, seed)) for seed in range(20)]
        [client.ended(own) for own in jobs]
        answers = {}
        paths = [f"/v1/jobs/{own}/{part}" for own in jobs for part in ("result", "generations")]
        paths += [f"/v1/datasets/{dataset}/samples"]
        for path in paths:
            answers[path] = client.ask("GET", path)[1]
        server.kill()
        files = [name for name in os.listdir(folder) if name.startswith("jobs.db") and not name.endswith("lock")]
        for trial in range(trials):
            with tempfile.TemporaryDirectory() as other:
                for name in files:
                    shutil.copy(os.path.join(folder, name), other)
                harmed = Server(options, other)
                if trial % 3 == 0 and "jobs.db-wal" in files:
                    log = os.path.join(other, "jobs.db-wal")
                    os.truncate(log, random_.randrange(os.path.getsize(log)))
                    kind, what = "log", os.path.getsize(log)
                elif trial % 3 == 1:
                    opened = sqlite3.connect(harmed.path)
                    names = [row[0] for row in opened.execute("select name from sqlite_master where type='table' and name not like 'sqlite%'")]
                    opened.execute("pragma foreign_keys = off")
                    what = random_.choice(names)
                    opened.execute(f'drop table "{what}"')
                    opened.commit()
                    opened.close()
                    kind = "schema"
                else:
                    # What stands in the log belongs to the file, too.
                    sqlite3.connect(harmed.path).execute("pragma wal_checkpoint(truncate)").close()
                    with open(harmed.path, "r+b") as file:
                        size = os.path.getsize(harmed.path)
                        for _ in range(100):
                            file.seek(random_.randrange(size))
                            file.write(bytes([random_.randrange(256)]))
                    kind, what = "bytes", 100
                by_check = harmed.command("check")[0] != 0
                if not harmed.start():
                    told["at start"] += 1
                    continue
                asks, wrong, refused, failed = harmed.client(), 0, 0, 0
                for path, expected in answers.items():
                    status, body, _ = asks.ask("GET", path)
                    refused += status != 200
                    # In an earlier state of the log the last jobs are not there (404) or not done (409).
                    failed += status not in (200, 404, 409)
                    # A log that is cut is an earlier state: what is there has to be the same.
                    wrong += status == 200 and body != expected and kind != "log"
                    wrong += status == 200 and kind == "log" and path.endswith("result") and body.get("parameters") != expected["parameters"]
                harmed.kill()
                key = "by check" if by_check else "WRONG" if wrong else "FAILED when asked for" if failed else "an earlier state" if refused and kind == "log" else "MISSING" if refused else "by neither, same answers"
                told[key] += 1
                if key.split()[0].isupper():
                    print(f"damage: trial {trial} ({kind} {what}): found by nothing; {wrong} answers are other, {failed} failed, {refused} refused")
    print("damage:", trials, "files;", ", ".join(f"{kind}: {count}" for kind, count in told.items()))
    return not (told["WRONG"] or told["MISSING"] or told["FAILED when asked for"])


def searched(client, job):
    """How long the search of a job takes: from when it runs to its last generation, by its events."""
    connection = http.client.HTTPConnection(*client.address, timeout=300)
    connection.request("GET", f"/v1/jobs/{job}/events", headers=client.headers)
    began = last = name = None
    with connection.getresponse() as stream:
        for line in stream:
            if line.startswith(b"event:"):
                name = line.split()[1]
            elif line.startswith(b"data:"):
                if name == b"state" and b"running" in line:
                    began = time.monotonic()
                elif name == b"generation":
                    last = time.monotonic()
                elif name == b"end":
                    break
    connection.close()
    return last - began


def cost(options):
    """What the search of random jobs was predicted to take against how long it took."""
    count, random_, seen = options.count or 200, random.Random(1), []
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder, "--jobs-at-once", "1", "--threads", "1")
        server.start()
        client = server.client()
        datasets = [client.store(samples) for samples in (500, 1500, 5000)]
        until = time.monotonic() + 60 * options.minutes
        for seed in range(count):
            if time.monotonic() > until:
                break
            spec = job(random_.choice(datasets), random_.randrange(20, 80), seed, random_.randrange(10, 40), refine=False)
            for name in random_.sample(["coulomb_friction", "offset"], random_.randrange(3)):
                spec["parameters"][name] = {"estimate": {}}
            _, body, _ = client.ask("POST", "/v1/jobs?validate_only=true", spec)
            predicted = body["predicted_cost"]
            own = client.submit(spec)
            took = searched(client, own)
            result = client.ask("GET", f"/v1/jobs/{own}/result")[1]
            derivatives = predicted["evaluations"] * predicted["derivatives_per_evaluation"]
            seen.append((took / derivatives, result["search"]["evaluations"] / predicted["evaluations"]))
        server.terminate()
    middle = percentile([rate for rate, _ in seen], 0.5)
    within = sum(0.5 <= rate / middle <= 2 for rate, _ in seen) / len(seen)
    evaluations = sum(0.5 <= share <= 2 for _, share in seen) / len(seen)
    print(f"cost: {len(seen)} random jobs; the searches of {within:.0%} took within a factor of 2 of what was predicted, "
          f"at {middle * 1e9:.2f} ns a derivative; the evaluations of {evaluations:.0%}")
    return within >= 0.9 and evaluations >= 0.9


# The guide's table of what fills the disk (src/dashboard/docs/running.md), in bytes of the file's pages: a job of 20
# generations of 8 candidates, of it each candidate, and an entry of the audit log.
JOB_BYTES, JOB_CANDIDATES, CANDIDATE_BYTES, AUDIT_ENTRY_BYTES = 67_600, 160, 61, 160
JOB_GENERATIONS = 20
# The file may be so many times as large as the table foretells.
MOST_OF_FORETOLD = 1.5


def foretold_bytes(path):
    """The bytes that the table gives for what a database holds: its jobs, recordings and audit entries."""
    with contextlib.closing(sqlite3.connect(path)) as opened:
        ask = lambda statement: opened.execute(statement).fetchone()[0] or 0
        jobs = ask("select count(*) from jobs where finished_at is not null")
        entries = ask("select count(*) from audit")
        recordings, samples = ask("select count(*) from datasets"), ask("select sum(bytes) from datasets")
        candidates = ask("select sum(kept) from candidate_records")
    # What a job has beside its candidates does not depend on their number.
    bytes_of_jobs = jobs * (JOB_BYTES - JOB_CANDIDATES * CANDIDATE_BYTES) + candidates * CANDIDATE_BYTES
    return bytes_of_jobs + samples + entries * AUDIT_ENTRY_BYTES, (jobs, recordings, entries)


def unfinished_jobs(path):
    with contextlib.closing(sqlite3.connect(path)) as opened:
        return opened.execute("select count(*) from jobs where finished_at is null").fetchone()[0]


def memory(options):
    """Many requests and jobs in short time, and what the process has of memory and of disk."""
    requests, jobs = options.count or 100_000, (options.count or 100_000) // 100
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder)
        server.start()
        client = server.client()
        dataset, lock, left, seen = client.store(400), threading.Lock(), [requests, jobs], []
        first = client.submit(small_job(dataset, JOB_GENERATIONS))
        client.ended(first)

        def asks():
            own = Client(server.address)
            while True:
                with lock:
                    left[0] -= 1
                    makes = left[1] > 0 and left[0] % 100 == 0
                    left[1] -= makes
                    if left[0] < 0:
                        return
                if makes:
                    own.submit(small_job(dataset, JOB_GENERATIONS, left[1]))
                    own.store(50 + left[1] % 300)
                else:
                    path = random.choice(["/v1/jobs?limit=20", f"/v1/jobs/{first}/result", "/v1/models", "/v1/nothing",
                                          f"/v1/jobs/{first}/report", "/metrics", f"/v1/jobs/{first}/trajectory"])
                    own.ask("GET", path)

        threads = [threading.Thread(target=asks) for _ in range(4)]
        began = time.monotonic()
        [thread.start() for thread in threads]
        while any(thread.is_alive() for thread in threads):
            time.sleep(1)
            seen.append(server.memory_mib())
        took = time.monotonic() - began
        while unfinished_jobs(server.path) and time.monotonic() - began < 2 * took:
            time.sleep(1)
        has = sum(os.path.getsize(server.path + end) for end in ("", "-wal") if os.path.exists(server.path + end))
        foretold, (kept_jobs, recordings, entries) = foretold_bytes(server.path)
        server.terminate()
    quarters = [max(part) for part in (seen[k * len(seen) // 4:(k + 1) * len(seen) // 4] for k in range(4)) if part]
    print(f"memory: {requests} requests and {jobs} jobs in {took:.0f} s; the most of each quarter "
          f"{', '.join(f'{mib:.0f}' for mib in quarters)} MiB; the database takes {has / 2**20:.1f} MiB of disk with its log, "
          f"where the guide foretells {foretold / 2**20:.1f} MiB for {kept_jobs} jobs, {recordings} recordings and "
          f"{entries} entries of the audit log", flush=True)
    return quarters[-1] <= 1.1 * quarters[1] and has <= MOST_OF_FORETOLD * foretold
