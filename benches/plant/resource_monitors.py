"""Monitors of a server that is killed: each window is estimated once, in order."""

import json
import time

from acknowledged import Kind
from resource_streams import KEY, MONITORED, VARIANTS, WINDOW_MS, WINDOWS, instant, window

# Monitors that are there at a time.
AT_ONCE = 3


class Watch:
    """A stream, the monitor of it, and how far both have come."""

    def __init__(self, number):
        self.number, self.variant, self.sent = number, number % VARIANTS, 0
        self.stream, self.path, self.created = f"/v1/streams/watched-{number}", None, None
        # Estimates that were shown, by the number of their window.
        self.estimated = {}
        # The window to which the monitor was moved, whether that was acknowledged, and the windows before it.
        self.target, self.is_moved, self.before_target = None, False, None
        # What is deleted at the end, in order, and the deletion that was cut off.
        self.leaving, self.leaves = None, None


class Monitors(Kind):
    name = "monitors"

    def __init__(self, plant):
        super().__init__(plant)
        self.watches, self.references = {}, {}

    def act(self, client):
        if len(self.watches) < AT_ONCE:
            self.number += 1
            self.watches[self.number] = Watch(self.number)
        watch = self.random.choice(list(self.watches.values()))
        if watch.leaving is not None:
            self.leave(client, watch)
        elif watch.sent == 0 or (watch.path and watch.sent <= WINDOWS and self.random.random() < 0.5):
            self.send_window(client, watch)
        elif watch.path is None:
            self.make(client, watch)
        elif watch.target is None and 2 <= watch.sent < WINDOWS - 1 and self.random.random() < 0.25:
            self.move(client, watch)
        else:
            self.look_at(client, watch)

    def send_window(self, client, watch):
        """Sends the next window; one that was cut off is sent again with its key."""
        headers = {KEY: f"{watch.stream} {watch.sent}"}
        self.call(client, "POST", watch.stream, window(watch.variant, watch.sent), headers, accept=(200, 201))
        watch.sent += 1
        self.count("windows sent")

    def make(self, client, watch):
        """Makes the monitor; where that was cut off the same key is sent again."""
        body = {"stream": watch.stream.rsplit("/", 1)[1], "window": {"length_s": WINDOW_MS / 1000}, "job": MONITORED}
        _, made = self.call(client, "POST", "/v1/monitors", body, {KEY: f"monitor {watch.number}"}, accept=(201,))
        watch.path, watch.created = f"/v1/monitors/{made['id']}", made
        self.count("made")

    def move(self, client, watch):
        """Has the monitor go on behind the next window that has not been sent."""
        target = watch.sent + 1
        watch.target = target
        status, shown = self.call(client, "POST", f"{watch.path}/move", {"from": instant(target * WINDOW_MS)},
                                  accept=(200, 409))
        if status == 409:
            # A job works a window just now: nothing was moved.
            watch.target = None
            return
        watch.is_moved = True
        self.count("moved")
        if shown["next_window"] != target:
            self.fault("contradicted", f"{watch.path} was moved to {target} and goes on with", shown["next_window"])

    def check(self, client):
        super().check(client)
        for watch in list(self.watches.values()):
            if watch.leaving is not None:
                self.settle_leave(client, watch)
            elif watch.path:
                self.look_at(client, watch)

    def windows(self, client, watch):
        """The windows that the monitor shows by number, or nothing where there is no monitor."""
        status, shown = self.call(client, "GET", f"{watch.path}/windows?limit=100", accept=(200, 404))
        if status == 404:
            return None
        numbers = [item["number"] for item in shown["items"]]
        if numbers != sorted(set(numbers), reverse=True):
            self.fault("doubled", f"{watch.path} shows the windows", numbers)
        return {item["number"]: item for item in shown["items"]}

    def look_at(self, client, watch):
        windows = self.windows(client, watch)
        if windows is None:
            self.fault("lost", f"{watch.path} was acknowledged and is not there")
            del self.watches[watch.number]
            return
        for number in sorted(windows):
            self.judge_window(watch, number, windows[number])
        for number in watch.estimated:
            if number not in windows:
                self.fault("lost", f"{watch.path} has shown window {number} and does not any more")
        self.judge_order(watch, windows)
        if watch.sent > WINDOWS and all(number in watch.estimated for number in self.last_windows(watch)):
            self.end(client, watch, windows)

    def judge_window(self, watch, number, item):
        shown = json.dumps([item["status"], item["start"], item["from"], item["parameters"]])
        if number in watch.estimated:
            if watch.estimated[number] != shown:
                self.fault("changed", f"{watch.path} window {number} was {watch.estimated[number]} and is", shown)
        elif item["status"] == "estimated":
            watch.estimated[number] = shown
            self.count("windows estimated")
            self.judge_same(watch, number, shown)
        elif item["status"] != "running":
            self.fault("lost", f"{watch.path} window {number} is not estimated", item)
            watch.estimated[number] = shown

    def judge_same(self, watch, number, shown):
        """Monitors of the same samples come to the same estimates, where the same windows came before."""
        place = (watch.variant, tuple(sorted(before for before in watch.estimated if before <= number)))
        reference = self.references.setdefault(place, (watch.path, shown))
        if reference[1] != shown:
            text = f"{watch.path} and {reference[0]} watch the same and come to {shown} and"
            self.fault("changed", text, reference[1])

    def last_windows(self, watch):
        """The windows with which all is done."""
        # Windows are estimated in order: with those behind a move that was cut off all are done.
        return range(watch.target or 0, WINDOWS)

    def judge_order(self, watch, windows):
        """The windows have no gap but the one that a move left."""
        numbers = sorted(windows)
        gaps = [(low, high) for low, high in zip([-1, *numbers], numbers) if high != low + 1]
        if [high for _, high in gaps] not in ([], [watch.target]):
            self.fault("lost", f"{watch.path}, moved to {watch.target}, shows the windows", numbers)
        if not watch.is_moved:
            return
        before = [number for number in numbers if number < watch.target]
        if watch.before_target is None:
            watch.before_target = before
        elif watch.before_target != before:
            self.fault("contradicted", f"{watch.path} was moved to {watch.target} behind {watch.before_target} and "
                       "works", before)

    def end(self, client, watch, windows):
        """All windows are estimated: looks for their jobs, and begins to delete everything."""
        label = watch.path.rsplit("/", 1)[1]
        _, listed = self.call(client, "GET", f"/v1/jobs?view=summary&limit=100&label=monitor:{label}", accept=(200,))
        jobs = sorted(item["id"] for item in listed["items"])
        if jobs != sorted(item["job"] for item in windows.values()):
            self.fault("doubled", f"{watch.path} has {len(windows)} windows and the jobs", jobs)
        for item in windows.values():
            self.judge_recording(client, watch, item)
            self.plant.note_end(item["job"], "succeeded")
        self.count("finished")
        parts = [path for item in windows.values() for path in (f"/v1/jobs/{item['job']}",
                                                                f"/v1/datasets/{item['dataset']}")]
        watch.leaving = [watch.path, watch.stream, *parts]

    def judge_recording(self, client, watch, item):
        """The recording of a window has the samples that were sent."""
        path = f"/v1/datasets/{item['dataset']}/samples"
        self.call(client, "GET", path, headers={"accept": "text/csv"}, accept=(200,))
        rows = [line.split(",") for line in client.text.decode().splitlines()]
        sent = window(watch.variant, item["number"])["signals"]
        for column, name in enumerate(rows[0][1:], 1):
            values = [float(row[column]) for row in rows[1:]]
            if values != sent[name.split(" ")[0]]["values"]:
                self.fault("changed", f"{path} of window {item['number']} of {watch.path} has other samples", values)

    def leave(self, client, watch):
        """Deletes the next of what belongs to a monitor that has done its work."""
        watch.leaves = watch.leaving[0]
        self.call(client, "DELETE", watch.leaves, accept=(204,))
        self.left(watch)
        self.count("deleted" if watch.leaves == watch.path else "parts deleted")
        watch.leaves = None

    def left(self, watch):
        path = watch.leaving.pop(0)
        self.gone.append(path)
        self.gone_paths.add(path)
        self.touch(path)
        if not watch.leaving:
            del self.watches[watch.number]

    def settle_leave(self, client, watch):
        """A deletion that was cut off has happened or not; all that is behind it is there."""
        if watch.leaves is not None:
            status, _ = self.show(client, watch.leaves)
            if status == 404:
                self.left(watch)
            watch.leaves = None
        for path in watch.leaving[:1]:
            status, _ = self.show(client, path)
            if status == 404:
                self.fault("lost", f"{path} of {watch.path} was not deleted and is not there")
                self.left(watch)

    def check_all(self, client):
        """Brings all monitors to their end."""
        super().check_all(client)
        while self.watches:
            self.act_on_all(client)
            time.sleep(0.02)
        for path in list(self.gone):
            self.look(client, path)

    def act_on_all(self, client):
        for watch in list(self.watches.values()):
            if watch.leaving is not None:
                self.leave(client, watch)
            elif watch.sent <= WINDOWS and (watch.path or watch.sent == 0):
                self.send_window(client, watch)
            elif watch.path is None:
                self.make(client, watch)
            else:
                self.look_at(client, watch)
