"""Changes of single bytes in the rows of a database, below the server: in a file and in a PostgreSQL."""

import contextlib
import dataclasses
import json
import os
import random
import shutil
import sqlite3
import string
import struct
import subprocess

# So many bytes around a changed byte tell its place in the file.
NEIGHBOURS = 20
DIGITS, LETTERS, PRINTABLE = string.digits, string.ascii_letters, string.printable[:95]


@dataclasses.dataclass
class Change:
    """A value of a row, before and after one of its bytes, digits or bits changed."""

    table: str
    column: str
    key: dict
    kind: str
    before: object
    after: object
    # The place of the changed byte in a text or a blob.
    place: int = 0
    is_in_the_file: bool = False

    def key_after(self):
        key = {**self.key, **({self.column: self.after} if self.column in self.key else {})}
        return [value.decode(errors="replace") if isinstance(value, bytes) else str(value) for value in key.values()]

    def __str__(self):
        key = ", ".join(f"{name}={shortened(value)}" for name, value in self.key.items())
        before, after = around(self.before, self.place), around(self.after, self.place)
        way = " in a page" if self.is_in_the_file else ""
        return f"{self.table}.{self.column} [{key}] byte {self.place}{way}: {before} -> {after}"


def shortened(value, limit=60):
    text = value.decode(errors="backslashreplace") if isinstance(value, bytes) else str(value)
    return text if len(text) <= limit else text[:limit] + "…"


def around(value, place):
    return repr(value[max(0, place - 12):place + 12]) if isinstance(value, bytes) else repr(value)


def changed_text(text, any_byte):
    """A text in UTF-8 of which one byte or character is another, and the place."""
    if not text:
        return None
    if any_byte and random.random() < 0.5:
        place = random.randrange(len(text))
        return text[:place] + bytes([text[place] ^ (1 << random.randrange(8))]) + text[place + 1:], place
    characters = text.decode()
    index = random.randrange(len(characters))
    alphabet = next((letters for letters in (DIGITS, LETTERS) if characters[index] in letters), PRINTABLE)
    character = random.choice([letter for letter in alphabet if letter != characters[index]])
    return (characters[:index] + character + characters[index + 1:]).encode(), len(characters[:index].encode())


def changed_bytes(content):
    if not content:
        return None
    place = random.randrange(len(content))
    return content[:place] + bytes([content[place] ^ random.randrange(1, 256)]) + content[place + 1:], place


def changed_integer(number, bits):
    """A number of which one digit or one bit is another."""
    if random.random() < 0.5:
        digits = str(abs(number))
        place = random.randrange(len(digits))
        digit = random.choice([digit for digit in DIGITS if digit != digits[place]])
        number = int(digits[:place] + digit + digits[place + 1:]) * (-1 if number < 0 else 1)
        if -(1 << (bits - 1)) <= number < 1 << (bits - 1):
            return number, 0
        return None
    flipped = (number & ((1 << bits) - 1)) ^ (1 << random.randrange(bits))
    return (flipped - (1 << bits) if flipped >> (bits - 1) else flipped), 0


def changed_real(number):
    flipped = struct.unpack("<Q", struct.pack("<d", number))[0] ^ (1 << random.randrange(64))
    real = struct.unpack("<d", struct.pack("<Q", flipped))[0]
    # A value that is no number is stored as null.
    return None if real != real else (real, 0)


class File:
    """The database of a file."""

    name = "SQLite"

    def __init__(self, path, folder):
        self.sound, self.path = path, os.path.join(folder, "trial.db")
        self.url = f"sqlite://{self.path}"
        with open(path, "rb") as file:
            self.content = file.read()
        with contextlib.closing(self.opened(path)) as opened:
            names = opened.execute("select name from sqlite_master where type = 'table' and name not like 'sqlite%'")
            self.tables = {name.decode(): self.rows(opened, name.decode()) for name, in names.fetchall()}

    def opened(self, path):
        opened = sqlite3.connect(path, timeout=30, isolation_level=None)
        opened.text_factory = bytes
        return opened

    def rows(self, opened, table):
        """The names of the key, and each row with the type of each value."""
        info = opened.execute(f'pragma table_info("{table}")').fetchall()
        names = [column[1].decode() for column in info]
        key = [column[1].decode() for column in sorted(info, key=lambda column: column[5]) if column[5]]
        selected = ", ".join(f'"{name}", typeof("{name}")' for name in names)
        rows = []
        for row in opened.execute(f'select {selected} from "{table}"'):
            values = zip(row[::2], (kind.decode() for kind in row[1::2]))
            rows.append({name: (kind, value) for name, (value, kind) in zip(names, values)})
        return key or names, rows

    def restore(self):
        for end in ("-wal", "-shm"):
            with contextlib.suppress(FileNotFoundError):
                os.remove(self.path + end)
        shutil.copy(self.sound, self.path)

    def remove(self):
        pass

    def changed(self, kind, value):
        if kind == "text":
            return changed_text(value, any_byte=True)
        if kind == "integer":
            return changed_integer(value, 64)
        return changed_bytes(value) if kind == "blob" else changed_real(value)

    def put(self, changes, is_running):
        """Puts changes into the database; answers those that could be put there."""
        applied = []
        for change in changes:
            in_page = not is_running and change.kind in ("text", "blob") and random.random() < 0.5
            if in_page and self.put_into_the_page(change) or self.update(change):
                applied.append(change)
            elif not is_running and change.kind in ("text", "blob") and self.put_into_the_page(change):
                applied.append(change)
        return applied

    def put_into_the_page(self, change):
        """Changes the byte where it stands in the file, if its neighbours are nowhere else."""
        start = max(0, change.place - NEIGHBOURS)
        neighbours = change.before[start:change.place + NEIGHBOURS]
        if len(neighbours) < 8 or self.content.count(neighbours) != 1 or len(change.before) != len(change.after):
            return False
        # A change that was put before as a statement has moved to a log or to another page.
        with contextlib.closing(self.opened(self.path)) as opened:
            opened.execute("pragma wal_checkpoint(truncate)")
        with open(self.path, "r+b") as file:
            content = file.read()
            if content.count(neighbours) != 1:
                return False
            file.seek(content.index(neighbours))
            file.write(change.after[start:change.place + NEIGHBOURS])
        change.is_in_the_file = True
        return True

    def update(self, change):
        """Changes a value by a statement that no trigger and no check sees."""
        with contextlib.closing(self.opened(self.path)) as opened:
            opened.execute("pragma ignore_check_constraints = on")
            opened.execute("begin immediate")
            try:
                triggers = opened.execute(
                    "select name, sql from sqlite_master where type = 'trigger' and tbl_name = ?",
                    (change.table,)).fetchall()
                for name, _ in triggers:
                    opened.execute(f"drop trigger {name.decode()}")
                value = "cast(? as text)" if change.kind == "text" else "?"
                where, arguments = self.where(change)
                done = opened.execute(f'update "{change.table}" set "{change.column}" = {value} where {where}',
                                      (change.after, *arguments))
                for _, sql in triggers:
                    opened.execute(sql.decode())
                opened.execute("commit")
                return done.rowcount == 1
            except sqlite3.Error:
                opened.execute("rollback")
                return False

    def where(self, change):
        parts = [f'"{name}" = cast(? as text)' if isinstance(value, bytes) else f'"{name}" is ?'
                 for name, value in change.key.items()]
        return " and ".join(parts), list(change.key.values())


class Base:
    """The database of a PostgreSQL."""

    name = "PostgreSQL"

    def __init__(self, postgres):
        self.postgres, self.number = postgres, 0
        # A changed byte asks neither a check nor where a value comes from.
        for table, name in self.ask("select conrelid::regclass, conname from pg_constraint where "
                                   "contype = 'c' and connamespace = 'public'::regnamespace"):
            self.ask(f"alter table {table} drop constraint {name}")
        generated = "select table_name, column_name from information_schema.columns where table_schema = 'public' and "
        for table, column in self.ask(generated + "is_identity = 'YES'"):
            self.ask(f'alter table "{table}" alter column "{column}" set generated by default')
        self.expressions = {(table, column) for table, column in self.ask(generated + "is_generated = 'ALWAYS'")}
        names = self.ask("select tablename from pg_tables where schemaname = 'public' order by 1")
        self.tables = {name: self.rows(name) for name, in names}
        self.database = None

    def ask(self, statement, database="greybox"):
        return [row for row in self.postgres.sql(statement, database) if row != [""]]

    def rows(self, table):
        columns = dict(self.ask("select column_name, udt_name from information_schema.columns where "
                                f"table_schema = 'public' and table_name = '{table}' order by ordinal_position"))
        key = self.ask("select attname from pg_index join pg_attribute on attrelid = indrelid and attnum = any(indkey) "
                       f"where indrelid = '\"{table}\"'::regclass and indisprimary "
                       "order by array_position(indkey, attnum)")
        selected = ", ".join(f'"{name}"::text' for name in columns)
        text = self.psql(f"select coalesce(json_agg(t), '[]') from (select {selected} from \"{table}\") t")
        rows = [{name: self.value(columns[name], value) for name, value in row.items()} for row in json.loads(text)]
        return [name for name, in key] or list(columns), rows

    def value(self, kind, text):
        if text is None:
            return "null", None
        if kind in ("int2", "int4", "int8"):
            return kind, int(text)
        if kind == "float8":
            return kind, float(text)
        if kind == "bytea":
            return kind, bytes.fromhex(text[2:])
        return kind, text.encode()

    def psql(self, script, database="greybox"):
        command = [os.path.join(self.postgres.bin, "psql"), "--no-psqlrc", "--quiet", "--tuples-only", "--no-align",
                   "--dbname", self.postgres.url(database, user="postgres")]
        return subprocess.run(command, input=script, capture_output=True, text=True).stdout

    def restore(self):
        self.remove()
        self.number += 1
        self.database = f"trial{self.number}"
        self.ask(f"create database {self.database} template greybox owner greybox", "postgres")
        self.url = self.postgres.url(self.database)

    def remove(self):
        if self.database:
            self.ask(f"drop database if exists {self.database} with (force)", "postgres")

    def changed(self, kind, value):
        if kind in ("int2", "int4", "int8"):
            return changed_integer(value, 8 * int(kind[3:]))
        if kind == "float8":
            return changed_real(value)
        if kind == "bytea":
            return changed_bytes(value)
        if kind == "bool":
            return (b"f" if value.startswith(b"t") else b"t"), 0
        return changed_text(value, any_byte=False)

    def literal(self, kind, value):
        if kind == "bytea":
            return f"decode('{value.hex()}', 'hex')"
        if isinstance(value, bytes):
            return f"convert_from(decode('{value.hex()}', 'hex'), 'UTF8')::{kind}"
        return f"'{value}'::{kind}"

    def put(self, changes, is_running):
        """Puts changes into the database; answers those that could be put there."""
        script = []
        for number, change in enumerate(changes):
            kinds = {name: kind for name, (kind, _) in self.tables[change.table][1][0].items()}
            key = " and ".join(f'"{name}" = {self.literal(kinds[name], value)}' for name, value in change.key.items())
            script.append("begin; set local session_replication_role = replica;")
            if (change.table, change.column) in self.expressions:
                script.append(f'alter table "{change.table}" alter column "{change.column}" drop expression;')
            script.append(f'update "{change.table}" set "{change.column}" = {self.literal(change.kind, change.after)} '
                          f"where {key} returning 'changed {number}'; commit;")
        text = self.psql("\n".join(script), self.database)
        return [change for number, change in enumerate(changes) if f"changed {number}" in text.splitlines()]


def columns_of(database):
    """All columns that hold a value in some row."""
    return sorted({(table, column) for table, (_, rows) in database.tables.items() for row in rows
                   for column, (_, value) in row.items() if value not in (None, b"")})


def draw(database, place=None):
    """A change of a random value, or of one in a given column; each table has its share, whatever its rows."""
    table, column = place or (random.choice([name for name, (_, rows) in database.tables.items() if rows]), None)
    keys, rows = database.tables[table]
    while True:
        row = random.choice(rows)
        filled = [name for name, (_, value) in row.items() if value not in (None, b"") and column in (None, name)]
        if not filled:
            continue
        name = random.choice(filled)
        kind, before = row[name]
        outcome = database.changed(kind, before)
        if outcome is not None and outcome[0] != before:
            return Change(table, name, {part: row[part][1] for part in keys}, kind, before, *outcome)
