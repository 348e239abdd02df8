"""What comes from outside while jobs are at work: a full disk, slow clients, stops, kills, another
project's queue, a clock that is set."""

import os
import random
import resource
import socket
import tempfile
import threading
import time

from server import Server, carriage, job, percentile


def full(options):
    """The disk is full at random moments while somebody submits."""
    rounds, worst, acknowledged, not_told = options.count or 100, 0.0, [], 0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder, "--slice-s", "0.05")
        server.start()
        client = server.client()
        dataset, going = client.store(60), True

        def submits():
            own, seed = server.client(), 0
            while going:
                seed += 1
                accepted = own.submit(job(dataset, 3, seed, refine=False))
                acknowledged.extend([accepted] if accepted else [])
                time.sleep(0.05)

        thread = threading.Thread(target=submits)
        thread.start()
        for _ in range(rounds):
            time.sleep(random.uniform(0, 0.3))
            server.limit_files(1)
            deadline, told = time.monotonic() + 10, False
            while not told and time.monotonic() < deadline:
                told = client.ask("GET", "/readyz")[0] == 503
            not_told += not told
            time.sleep(random.uniform(0, 0.5))
            server.limit_files(None)
            room = time.monotonic()
            while not (accepted := client.submit(job(dataset, 3, 1, refine=False))):
                pass
            while client.ask("GET", "/readyz")[0] != 200:
                pass
            acknowledged.append(accepted)
            worst = max(worst, time.monotonic() - room)
        going = False
        thread.join()
        lost = sum(client.ended(own)["status"] != "succeeded" for own in acknowledged)
        server.terminate()
    print(f"full: {rounds} times; ready and written again after {worst:.2f} s at the most; "
          f"/readyz not 503 in {not_told}; of {len(acknowledged)} acknowledged jobs {lost} did not succeed")
    return worst <= 5 and not lost and not not_told


def slow(options):
    """Many clients that send or read nothing for long, one kind after the other."""
    seconds = options.seconds or 6
    clients = options.count or 1000
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, 2 * clients + 200)), hard))
    good = True
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder)
        server.start()
        client = server.client()
        dataset, large = client.store(2000), client.store(100_000)
        ended = client.submit(job(dataset, 2))
        client.ended(ended)
        work = client.submit(job(dataset, 1_000_000, 1, 30))
        head = b" HTTP/1.1\r\nhost: 127.0.0.1\r\n"
        kinds = {
            "heads": b"GET /v1/jobs" + head + b"x-a: ",
            "bodies": b"POST /v1/jobs" + head + b"content-type: application/json\r\ncontent-length: 60000\r\n\r\n{",
            "uploads": b"POST /v1/datasets" + head + b"content-type: text/csv\r\ncontent-length: 60000\r\n\r\ntime",
            "readers": f"GET /v1/datasets/{large}/samples".encode() + head + b"accept: text/csv\r\n\r\n",
            "streams": f"GET /v1/jobs/{work}/events".encode() + head + b"\r\n",
        }

        def speed():
            """Generations a second of the job, and the times of others' requests, over a few seconds."""
            began, first, times = time.monotonic(), client.show(work)["progress"]["generation"], []
            while time.monotonic() - began < seconds:
                at = time.monotonic()
                path = random.choice(["/v1/jobs?limit=5", f"/v1/jobs/{ended}/result", "/v1/models"])
                if random.random() < 0.2:
                    status = client.ask("POST", "/v1/datasets", carriage(50), {"content-type": "text/csv"})[0]
                else:
                    status = client.ask("GET", path)[0]
                times.append(time.monotonic() - at if status in (200, 201) else float("inf"))
                time.sleep(0.02)
            last = client.show(work)["progress"]["generation"]
            return (last - first) / (time.monotonic() - began), times

        for kind, text in kinds.items():
            before, _ = speed()
            sockets = []
            for _ in range(clients):
                own = socket.socket()
                own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
                # A neighbour's address: callers of a server without tokens take turns by theirs.
                own.bind(("127.0.0.2", 0))
                own.connect(server.address)
                own.send(text)
                sockets.append(own)
            # What they ask at first is work; that they are slow is looked at after it.
            at_once, came = speed()
            time.sleep(seconds)
            during, times = speed()
            for own in sockets:
                own.close()
            time.sleep(1)
            after, _ = speed()
            share = 2 * during / (before + after)
            p99 = percentile(times, 0.99)
            print(f"slow {kind}: {clients} clients; others' p99 {p99 * 1e3:.0f} ms of {len(times)} requests "
                  f"({percentile(came, 0.99) * 1e3:.0f} ms of {len(came)} while they come); "
                  f"the job goes on at {share:.0%} of its speed ({before:.1f} before, {at_once:.1f} while they come, "
                  f"{during:.1f}, {after:.1f} after, generations/s)")
            good &= max(p99, percentile(came, 0.99)) < 1 and share >= 0.8
        client.ask("POST", f"/v1/jobs/{work}/cancel")
        server.terminate()
    return good


def stops(options):
    """Cancel, pause and SIGTERM at random moments of jobs on recordings of several sizes."""
    trials, good = options.count or 8, True
    for samples in (12_000, 100_000, 1_000_000):
        with tempfile.TemporaryDirectory() as folder:
            server = Server(options, folder)
            server.start()
            client = server.client()
            dataset = client.store(samples)
            took = {"cancel": [], "pause": []}
            for action, wanted in (("cancel", ("cancelled",)), ("pause", ("paused",))):
                for trial in range(trials):
                    own = client.submit(job(dataset, 4, trial, 8))
                    time.sleep(random.uniform(0, 4 * samples / 100_000 + 0.5))
                    began = time.monotonic()
                    status, body, _ = client.ask("POST", f"/v1/jobs/{own}/{action}")
                    while status in (200, 202) and client.show(own)["status"] not in (*wanted, "succeeded"):
                        pass
                    took[action].append(time.monotonic() - began)
                    client.ask("POST", f"/v1/jobs/{own}/cancel")
            many = [client.submit(job(dataset, 4, trial, 8)) for trial in range(50)]
            time.sleep(1)
            began = time.monotonic()
            for own in many:
                client.ask("POST", f"/v1/jobs/{own}/cancel")
            while any(client.show(own)["status"] in ("queued", "running") for own in many):
                pass
            together = time.monotonic() - began
            ends = []
            for trial in range(max(3, trials // 2)):
                for seed in range(4):
                    client.submit(job(dataset, 4, 100 + 10 * trial + seed, 8))
                asked = threading.Thread(target=server.client().ask, args=(
                    "POST", "/v1/jobs?validate_only=true", job(dataset)))
                asked.start()
                time.sleep(random.uniform(0, 4 * samples / 100_000 + 0.5))
                ends.append(server.terminate())
                asked.join()
                server.start()
                client = server.client()
            server.kill()
        print(f"stops {samples} samples: cancel {max(took['cancel']):.2f} s, pause {max(took['pause']):.2f} s at the "
              f"most of {trials} each; 50 cancelled together {together:.2f} s; SIGTERM {max(ends):.2f} s of {len(ends)}")
        good &= max(took["cancel"] + took["pause"]) <= 2 and max(ends) <= 5
    return good


def turns(options):
    """Two projects, one of which has queued many jobs."""
    many, slice_s = options.count or 10_000, 2.0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder, "--slice-s", str(slice_s), "--requests-per-second", "100000")
        tokens = [server.token(name, project=name) for name in ("first", "second")]
        server.start()
        first, second = (server.client(token) for token in tokens)
        own = first.store(2000)
        other = second.store(2000)

        def submits(seed):
            client = server.client(tokens[0])
            for k in range(many // 4):
                assert client.submit(job(own, 200, seed + k))

        threads = [threading.Thread(target=submits, args=(part * many,)) for part in range(4)]
        began = time.monotonic()
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        queued, waits = time.monotonic() - began, []
        for seed in range(5):
            at = time.monotonic()
            mine = second.submit(job(other, 1, seed))
            while second.show(mine)["started_at"] is None:
                time.sleep(0.005)
            waits.append(time.monotonic() - at)
            second.ended(mine)
        server.kill()
    print(f"turns: {many} jobs of one project queued in {queued:.0f} s; the other's begin after "
          f"{max(waits):.2f} s at the most of {len(waits)}, with slices of {slice_s} s")
    return max(waits) <= slice_s + 0.5


def kills(options):
    """kill -9 at random moments while jobs and comparisons come, each with a key."""
    count, submitted, compared, doubled = options.count or 300, {}, {}, 0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options, folder, "--slice-s", "0.1")
        server.start()
        dataset = server.client().store(60)
        for turn in range(count):
            client, until = server.client(), time.monotonic() + random.uniform(0.05, 0.6)
            killer = threading.Timer(until - time.monotonic(), server.process.kill)
            killer.start()
            alive = True
            while alive:
                key = f"{turn} {len(submitted)}"
                accepted = client.submit(job(dataset, 4, turn, refine=False), key)
                again = accepted and client.submit(job(dataset, 4, turn, refine=False), key)
                doubled += bool(again and again != accepted)
                alive = bool(accepted)
                submitted.update({key: accepted} if accepted else {})
                if turn % 3 == 0 and alive:
                    body = {"job": job(dataset, 3, refine=False), "methods": ["icra_genetic", "cma_es"], "seeds": 2}
                    status, made, _ = client.ask("POST", "/v1/comparisons", body, {"idempotency-key": f"c {key}"})
                    assert status in (0, 202, 503), made
                    compared.update({f"c {key}": made["id"]} if status == 202 else {})
                    alive = status != 0
                time.sleep(0.05)
            killer.join()
            server.process.wait()
            server.process.stdout.close()
            assert server.start(), "the server did not start again"
        client = server.client()
        lost = failed = parts = 0
        for key, accepted in submitted.items():
            shown = client.ended(accepted)
            failed += shown["status"] != "succeeded"
            doubled += client.submit(job(dataset, 4, int(key.split()[0]), refine=False), key) != accepted
        for own in compared.values():
            status, shown, _ = client.ask("GET", f"/v1/comparisons/{own}")
            parts += status != 200 or len(shown["jobs"]) != 4
        _, all_of_them, _ = client.ask("GET", "/v1/comparisons?limit=500")
        parts += sum(listed["runs"] != 4 for listed in all_of_them["items"])
        server.terminate()
    print(f"kills: {count}; of {len(submitted)} acknowledged jobs {lost} lost, {failed} did not succeed, {doubled} "
          f"made twice; of {len(compared)} acknowledged comparisons, and all others, {parts} not whole")
    return not (lost or failed or doubled or parts)


def clock(options):
    """The clock is set by a day, with and without a restart, while jobs wait in the queue."""
    if not options.faketime:
        print("clock: NOT MEASURED: --faketime names no libfaketime")
        return True
    worst = 0.0
    for shift in ("-1d", "+1d"):
        for restarts in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                now = os.path.join(folder, "now")
                with open(now, "w") as file:
                    file.write("+0")
                server = Server(options, folder, "--jobs-at-once", "1", environment={
                    "LD_PRELOAD": options.faketime, "FAKETIME_TIMESTAMP_FILE": now,
                    "FAKETIME_CACHE_DURATION": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1"})
                server.start()
                client = server.client()
                dataset = client.store(150)
                long = client.submit(job(dataset, 100_000))
                waiting = [client.submit(job(dataset, 2, seed, refine=False)) for seed in range(7)]
                with open(now, "w") as file:
                    file.write(shift)
                time.sleep(1.5)
                if restarts:
                    server.terminate()
                    server.start()
                    client = server.client()
                client.ask("POST", f"/v1/jobs/{long}/cancel")
                while client.show(long)["status"] != "cancelled":
                    time.sleep(0.005)
                # One place: from one's end to another's beginning, whichever is next.
                free, left = time.monotonic(), set(waiting)
                while left and time.monotonic() - free < 20:
                    shown = {own: client.show(own)["status"] for own in left}
                    begun = {own for own, status in shown.items() if status != "queued"}
                    if begun:
                        worst = max(worst, time.monotonic() - free)
                        [client.ended(own) for own in begun]
                        left -= begun
                        free = time.monotonic()
                worst = max(worst, 20.0 if left else 0.0)
                server.kill()
    print(f"clock: a day back and forth, with and without a restart; queued jobs begin after {worst:.2f} s at the most")
    return worst <= 1
