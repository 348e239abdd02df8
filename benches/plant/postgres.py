"""A PostgreSQL of the measurement's own, and a way to it that can be cut and led elsewhere.

    python3 benches/plant/postgres.py COMMAND [ARGUMENT...]

runs a command with a new database, whose address stands for {} in its arguments."""

import atexit
import glob
import os
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from signal import SIGCONT, SIGINT, SIGKILL

HOST = "127.0.0.1"


def programs():
    """The folder of its programs; nothing where it is not installed."""
    folders = sorted(glob.glob("/usr/lib/postgresql/*/bin"), reverse=True)
    folders += os.environ.get("PATH", "").split(os.pathsep)
    needed = ("initdb", "postgres", "pg_isready", "pg_basebackup", "pg_ctl", "psql")
    whole = (folder for folder in folders if all(os.path.exists(os.path.join(folder, one)) for one in needed))
    return next(whole, None)


def free_port():
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


class Postgres:
    """A server with an empty database `greybox`; with `of` a standby of another."""

    def __init__(self, of=None, **settings):
        self.bin, self.port = programs(), free_port()
        self.folder = tempfile.mkdtemp(prefix="postgres-")
        # It does not run as root.
        self.user = pwd.getpwnam("nobody") if os.getuid() == 0 else None
        if self.user:
            os.chown(self.folder, self.user.pw_uid, self.user.pw_gid)
        self.data, self.settings = os.path.join(self.folder, "data"), settings
        if of is None:
            self.run("initdb", "--username=postgres", "--auth=trust", "--encoding=UTF8", "-D", self.data)
        else:
            self.run("pg_basebackup", "--pgdata", self.data, "--write-recovery-conf", "--wal-method=stream",
                     "--dbname", f"{of.url('postgres', user='postgres')}?application_name=standby")
        atexit.register(self.remove)
        self.start()
        if of is None:
            self.sql("create role greybox login", "postgres")
            self.sql("create database greybox owner greybox", "postgres")

    def as_user(self):
        return {"user": self.user.pw_uid, "group": self.user.pw_gid} if self.user else {}

    def run(self, program, *arguments):
        done = subprocess.run([os.path.join(self.bin, program), *arguments], capture_output=True, text=True,
                              cwd=self.folder, **self.as_user())
        assert done.returncode == 0, done.stderr
        return done.stdout

    def start(self):
        command = [os.path.join(self.bin, "postgres"), "-D", self.data, "-k", self.folder, "-p", str(self.port),
                   "-c", f"listen_addresses={HOST}", "-c", "max_connections=120"]
        for name, value in self.settings.items():
            command += ["-c", f"{name}={value}"]
        log = open(os.path.join(self.folder, "log"), "a")
        self.process = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True, cwd=self.folder,
                                        **self.as_user())
        while subprocess.run([os.path.join(self.bin, "pg_isready"), "--quiet", "-h", HOST, "-p",
                              str(self.port)]).returncode:
            time.sleep(0.05)

    def url(self, database="greybox", port=None, user="greybox"):
        return f"postgres://{user}@{HOST}:{port or self.port}/{database}"

    def sql(self, statement, database="greybox"):
        """The rows of a statement, as lists of texts."""
        said = self.run("psql", "--no-psqlrc", "--tuples-only", "--no-align", "--dbname",
                        self.url(database, user="postgres"), "--command", statement)
        return [line.split("|") for line in said.splitlines()]

    def number(self, statement):
        return float(self.sql(statement)[0][0] or 0)

    def processes(self):
        own = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True).stdout
        return [self.process.pid, *map(int, own.split())]

    def signal(self, which):
        for process in self.processes():
            try:
                os.kill(process, which)
            except ProcessLookupError:
                pass

    def stop(self, how=SIGINT):
        """Ends it: in order, or with SIGKILL as when its machine fails."""
        if how == SIGKILL:
            self.signal(how)
        else:
            self.process.send_signal(how)
        self.process.wait()

    def remove(self):
        if self.process.poll() is None:
            self.signal(SIGCONT)
            self.stop(SIGKILL)
        shutil.rmtree(self.folder, ignore_errors=True)


class Way:
    """A way to a port that can be cut, so that nothing comes through, and led to another port."""

    def __init__(self, port):
        self.to, self.is_open, self.losses = port, threading.Event(), 0
        self.is_open.set()
        self.listener = socket.create_server((HOST, 0))
        self.port, self.all = self.listener.getsockname()[1], []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            own, _ = self.listener.accept()
            threading.Thread(target=self.connect, args=(own,), daemon=True).start()

    def connect(self, own):
        self.is_open.wait()
        try:
            other = socket.create_connection((HOST, self.to))
        except OSError:
            own.close()
            return
        self.all += [own, other]
        for source, sink in ((own, other), (other, own)):
            threading.Thread(target=self.carry, args=(source, sink), daemon=True).start()

    def carry(self, source, sink):
        losses = self.losses
        try:
            while piece := source.recv(65536):
                self.is_open.wait()
                if losses < self.losses:
                    # It stays open, and nothing comes through any more.
                    threading.Event().wait()
                sink.sendall(piece)
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def lose(self):
        """Loses all connections without telling either end."""
        self.losses += 1

    def lead_to(self, port):
        """Breaks all connections off; new ones go to another port."""
        self.to, broken, self.all = port, self.all, []
        for end in broken:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


if __name__ == "__main__":
    address = Postgres().url()
    sys.exit(subprocess.run([part.replace("{}", address) for part in sys.argv[1:]]).returncode)
