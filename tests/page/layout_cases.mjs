// The files of the tests are of kinds that plants have. Each case has the bytes of a file, what a person does on
// the page with it, what the page then tells of it, and the samples that the recording has to have.
//
// A step names a control by its label: `choose` picks an option by its words, `type` fills a field, and `press`
// presses a button.

import fs from "node:fs";
import zlib from "node:zlib";

const COUNT = 8;
const INSTANTS = Array.from({ length: COUNT }, (_, k) => k);
const flow = (k) => 20 + k * 0.25;
const pressure = (k) => 1.5 + ((k * 3) % 5) * 0.5;
const TENTHS = INSTANTS.map((k) => k / 10);

const clock = (k) => `08:00:0${k}`;
const comma = (value, digits = 2) => value.toFixed(digits).replace(".", ",");
const lines = (top, row) => [...top, ...INSTANTS.flatMap(row), ""].join("\n");

// The recording keeps its values in SI.
const BAR = ["Pa", 1e5];
const CELSIUS = ["K", 1, 273.15];
const LITRES = ["m³/s", 1e-3 / 60];
const RPM = ["rad/s", (2 * Math.PI) / 60];
const PLAIN = ["", 1];
const signal = (values, [unit, factor, offset = 0]) => ({
  unit,
  values: values.map((value) => (value === null ? null : value * factor + offset)),
});
const FLOWS = INSTANTS.map(flow);
const FLOWS_WITHOUT_ONE = FLOWS.map((value, k) => (k === 2 ? null : value));
const PRESSURES = INSTANTS.map(pressure);
const isMorning = (day, hour) => `${day}T0${hour}:00:00Z`;

const ZONE = ["type", "Time zone of its clock", "Europe/Berlin"];
const ROWS_OF_ONE = ["choose", "Each row holds", "one sample of one signal"];
const UNSAID = ["press", "What the file does not say"];

export const CASES = [
  {
    name: "a row for each sample, with decimal commas and a word among the values",
    file: "Leitsystem.csv",
    content: lines(["Zeitpunkt;Messstelle;Wert"], (k) => [
      `13.03.2026 ${clock(k)};Druck;${comma(pressure(k))}`,
      `13.03.2026 ${clock(k)};Temperatur;${k === 2 ? "NA" : comma(flow(k))}`,
    ]),
    asks: "say tag, such as Messstelle",
    steps: [ROWS_OF_ONE, ZONE],
    roles: ["Time", "Tag (name of the signal)", "Value"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: isMorning("2026-03-13", 7),
      time: INSTANTS,
      signals: { Druck: signal(PRESSURES, PLAIN), Temperatur: signal(FLOWS_WITHOUT_ONE, PLAIN) },
    },
  },
  {
    name: "several machines with several values in each row",
    file: "Hallen.csv",
    content: lines(["Zeit;Anlage;p [bar];T [°C]"], (k) => [
      `2026-03-13 ${clock(k)};Nord;${comma(pressure(k))};${comma(flow(k))}`,
      `2026-03-13 ${clock(k)};Sued;${comma(pressure(k) + 1)};${comma(flow(k) + 1)}`,
    ]),
    asks: "rows of one time differ by Anlage",
    steps: [
      ROWS_OF_ONE,
      ["choose", "Role of column 3", "Value"],
      ["choose", "Role of column 4", "Value"],
      ZONE,
    ],
    roles: ["Time", "Tag (name of the signal)", "Value", "Value"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: isMorning("2026-03-13", 7),
      time: INSTANTS,
      signals: {
        "Nord.p": signal(PRESSURES, BAR),
        "Nord.T": signal(FLOWS, CELSIUS),
        "Sued.p": signal(
          PRESSURES.map((value) => value + 1),
          BAR,
        ),
        "Sued.T": signal(
          FLOWS.map((value) => value + 1),
          CELSIUS,
        ),
      },
    },
  },
  {
    name: "codes above the titles, and a row of units below them",
    file: "datalogger.csv",
    content: lines(["TOA5,CR1000,4711", "Time,Flow,Pressure", "s,l/min,bar"], (k) => [
      `${(k / 10).toFixed(1)},${flow(k)},${pressure(k)}`,
    ]),
    steps: [],
    lines: ["left out", "titles", "units"],
    roles: ["Time", "Signal", "Signal"],
    read: "titles in line 2, units in line 3, samples from line 4 on; commas separate the columns",
    truth: {
      time: TENTHS,
      signals: { Flow: signal(FLOWS, LITRES), Pressure: signal(PRESSURES, BAR) },
    },
  },
  {
    name: "no titles at all",
    file: "raw.txt",
    content: lines([], (k) => [`${(k / 10).toFixed(1)},${flow(k)},${pressure(k)}`]),
    asks: "where a name is expected",
    steps: [
      ["choose", "What line 1 is", "neither"],
      ["choose", "What its times are", "seconds"],
      ["type", "Unit of column 2", "l/min"],
      ["type", "Unit of column 3", "bar"],
      UNSAID,
      ["type", "New names", "column_2:flow, column_3:pressure"],
    ],
    lines: ["data"],
    roles: ["Time", "Signal", "Signal"],
    read: "no titles, samples from line 1 on; commas separate the columns",
    truth: {
      time: TENTHS,
      signals: { flow: signal(FLOWS, LITRES), pressure: signal(PRESSURES, BAR) },
    },
  },
  {
    name: "three lines above the titles",
    file: "Bericht.csv",
    content: lines(
      ["Anlage 7", "Export vom 13.03.2026", "Leitung: Dampf", "t [s];Durchfluss [l/min];Druck [bar]"],
      (k) => [`${comma(k / 10, 1)};${comma(flow(k))};${comma(pressure(k))}`],
    ),
    steps: [],
    notes: "3 lines above the data are no rows of the table",
    lines: ["left out", "left out", "left out", "titles"],
    roles: ["Time", "Signal", "Signal"],
    read: "titles in line 4, samples from line 5 on; semicolons separate the columns",
    truth: {
      time: TENTHS,
      signals: { Durchfluss: signal(FLOWS, LITRES), Druck: signal(PRESSURES, BAR) },
    },
  },
  {
    name: "comments of a recorder, and a column that is left out",
    file: "recorder.csv",
    content: lines(
      ["# recorder 4711", "# rate: 10 Hz", "time [s],flow [l/min],status word,pressure [bar]"],
      (k) => [`${(k / 10).toFixed(1)},${flow(k)},${4096 + k},${pressure(k)}`],
    ),
    steps: [["choose", "Role of column 3", "Left out"]],
    lines: ["left out", "left out", "titles"],
    roles: ["Time", "Signal", "Left out", "Signal"],
    read: "titles in line 3, samples from line 4 on; commas separate the columns",
    truth: {
      time: TENTHS,
      signals: { flow: signal(FLOWS, LITRES), pressure: signal(PRESSURES, BAR) },
    },
  },
  {
    name: "the date and the time of day in two columns",
    file: "Schicht.csv",
    content: lines(["Datum;Uhrzeit;Drehzahl [1/min]"], (k) => [
      `13.07.2026;${clock(k)};${comma(1400 + flow(k))}`,
    ]),
    asks: "has no time zone offset",
    steps: [ZONE],
    roles: ["Time", "Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: isMorning("2026-07-13", 6),
      time: INSTANTS,
      signals: {
        Drehzahl: signal(
          FLOWS.map((value) => 1400 + value),
          RPM,
        ),
      },
    },
  },
  {
    name: "a quality beside each value, and a signal that is left out",
    file: "historian.csv",
    content: lines(["Time;FIC101;FIC101_Quality;PI7;PI7_Quality;LI3;LI3_Quality"], (k) => [
      `2026-03-13T${clock(k)}Z;${flow(k)};${k === 3 ? "Bad" : "Good"};${pressure(k)};Good;7;Good`,
    ]),
    steps: [
      ["type", "Unit of column 2", "l/min"],
      ["type", "Unit of column 4", "bar"],
      ["choose", "Role of column 6", "Left out"],
    ],
    roles: ["Time", "Signal", "Quality", "Signal", "Quality", "Left out", "Quality"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: isMorning("2026-03-13", 8),
      time: INSTANTS,
      signals: {
        FIC101: signal(FLOWS.with(3, null), LITRES),
        PI7: signal(PRESSURES, BAR),
      },
    },
  },
  {
    name: "a time beside each signal, put on instants that are said",
    file: "scope.csv",
    content: lines(["PT Time [s],PT [bar],TT Time [s],TT [degC]"], (k) => [
      `${(k / 10).toFixed(1)},${pressure(k)},${(k / 5).toFixed(1)},${flow(k)}`,
    ]),
    notes: "put on a grid of 0.1 s",
    steps: [UNSAID, ["type", "Common instants", "200ms"]],
    roles: ["Time", "Signal", "Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      time: INSTANTS.map((k) => k / 5),
      signals: {
        PT: signal(
          INSTANTS.map((k) => (2 * k < COUNT ? pressure(2 * k) : null)),
          BAR,
        ),
        TT: signal(FLOWS, CELSIUS),
      },
    },
  },
  {
    name: "a time beside each signal, as Simulink writes it",
    file: "simulation.csv",
    content: lines(["Time,A,Time,B"], (k) => [`${k},${flow(k)},${k},${pressure(k)}`]),
    steps: [],
    heads: ["Line", "Time", "A", "Time", "B"],
    roles: [],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: { time: INSTANTS, signals: { A: signal(FLOWS, PLAIN), B: signal(PRESSURES, PLAIN) } },
  },
  {
    name: "dates that may have the day or the month first",
    file: "april.csv",
    content: lines(["Date,Speed [rpm]"], (k) => [`03/04/2026 ${clock(k)},${1400 + flow(k)}`]),
    asks: "may be of two days",
    steps: [["choose", "What its times are", "dates, day first"], ZONE],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      start: isMorning("2026-04-03", 6),
      time: INSTANTS,
      signals: {
        Speed: signal(
          FLOWS.map((value) => 1400 + value),
          RPM,
        ),
      },
    },
  },
  {
    name: "days of MATLAB",
    file: "rig.csv",
    content: lines(["time,speed [rpm]"], (k) => [`${(740000 + k / 86_400).toFixed(9)},${1400 + flow(k)}`]),
    asks: "may be days of MATLAB (datenum) or seconds",
    steps: [
      ["choose", "What its times are", "MATLAB's days (datenum)"],
      ["type", "Time zone of its clock", "UTC"],
    ],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      start: isMorning("2026-01-18", 0),
      time: INSTANTS,
      tolerance: 1e-4,
      signals: {
        speed: signal(
          FLOWS.map((value) => 1400 + value),
          RPM,
        ),
      },
    },
  },
  {
    name: "serial days of a spreadsheet",
    file: "Tabelle.csv",
    content: lines(["Datum;T [°C]"], (k) => [`${comma(46_094.25 + k / 86_400, 9)};${comma(flow(k))}`]),
    asks: "may be serial days of a spreadsheet or seconds",
    steps: [["choose", "What its times are", "Excel's serial days"], ZONE],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: isMorning("2026-03-13", 5),
      time: INSTANTS,
      tolerance: 1e-4,
      signals: { T: signal(FLOWS, CELSIUS) },
    },
  },
  {
    name: "seconds of LabVIEW, separated by tabs",
    file: "acquisition.tsv",
    content: lines(["X_Value\tVoltage [V]"], (k) => [`${3_856_000_000 + k / 10}\t${flow(k)}`]),
    asks: "may be seconds since 1904 (LabVIEW)",
    steps: [["choose", "What its times are", "LabVIEW's seconds since 1904"]],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; tabs separate the columns",
    truth: {
      start: "2026-03-10T15:06:40Z",
      time: TENTHS,
      tolerance: 1e-6,
      signals: { Voltage: signal(FLOWS, ["V", 1]) },
    },
  },
  {
    name: "units that are not known, or that may be two",
    file: "units.csv",
    content: lines(["time [s],pressure [mPa],feed [skt],level [m]"], (k) => [
      `${(k / 10).toFixed(1)},${pressure(k)},${flow(k)},${k}`,
    ]),
    asks: "unit mPa may be what its letters say or MPa",
    steps: [
      ["press", "Unit of pressure: MPa"],
      ["type", "Unit of column 3", "l/min"],
    ],
    roles: ["Time", "Signal", "Signal", "Signal"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      time: TENTHS,
      signals: {
        pressure: signal(PRESSURES, ["Pa", 1e6]),
        feed: signal(FLOWS, LITRES),
        level: signal(INSTANTS, ["m", 1]),
      },
    },
  },
  {
    name: "a number that stands for no sample",
    file: "gaps.csv",
    content: lines(["time [s],flow [l/min],pressure [bar]"], (k) => [
      `${(k / 10).toFixed(1)},${k === 3 ? -999 : flow(k)},${pressure(k)}`,
    ]),
    notes: "1 samples are exactly −999",
    steps: [["press", "What stands for no sample: -999"]],
    roles: ["Time", "Signal", "Signal"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      time: TENTHS,
      signals: { flow: signal(FLOWS.with(3, null), LITRES), pressure: signal(PRESSURES, BAR) },
    },
  },
  {
    name: "a comma that may stand before a fraction or between thousands",
    file: "Waage.csv",
    content: lines(["time;weight [kg]"], (k) => [`${k};1,05${k}`]),
    asks: "its comma may stand before a fraction or between thousands",
    steps: [["press", "Decimal sign: comma"]],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      time: INSTANTS,
      signals: {
        weight: signal(
          INSTANTS.map((k) => 1.05 + k / 1000),
          ["kg", 1],
        ),
      },
    },
  },
  {
    name: "a set point that is held, and a signal at instants of its own",
    file: "events.csv",
    content: lines(["Time,Tag,Value"], (k) => [
      ...(k % 4 === 0 ? [`2026-03-13T${clock(k)}Z,valve,${40 + 5 * k}`] : []),
      `2026-03-13T${clock(k)}Z,flow,${flow(k)}`,
      ...(k === COUNT - 1 ? [`2026-03-13T${clock(k)}Z,valve,80`] : []),
    ]),
    notes: "the signals have instants of their own",
    steps: [UNSAID, ["type", "Between samples", "valve:hold"], ["type", "Common instants", "500ms"]],
    roles: ["Time", "Tag (name of the signal)", "Value"],
    read: "titles in line 1, samples from line 2 on; commas separate the columns",
    truth: {
      start: isMorning("2026-03-13", 8),
      time: Array.from({ length: 2 * COUNT - 1 }, (_, k) => k / 2),
      signals: {
        valve: signal(
          Array.from({ length: 2 * COUNT - 1 }, (_, k) => (k < 8 ? 40 : k < 14 ? 60 : 80)),
          PLAIN,
        ),
        flow: signal(
          Array.from({ length: 2 * COUNT - 1 }, (_, k) => flow(k / 2)),
          PLAIN,
        ),
      },
    },
  },
  {
    name: "a text of an old encoding, separated by tabs",
    file: "Altsystem.txt",
    content: Buffer.from(
      lines(["Zeit [s]\tKühlwasser [°C]\tDurchfluß [l/min]"], (k) => [
        `${comma(k / 10, 1)}\t${comma(pressure(k))}\t${comma(flow(k))}`,
      ]),
      "latin1",
    ),
    asks: "the text is not UTF-8",
    steps: [["press", "Encoding: windows-1252"]],
    roles: ["Time", "Signal", "Signal"],
    read: "titles in line 1, samples from line 2 on; tabs separate the columns",
    truth: {
      time: TENTHS,
      signals: { Kühlwasser: signal(PRESSURES, CELSIUS), Durchfluß: signal(FLOWS, LITRES) },
    },
  },
  {
    name: "the newest row first, in UTF-16",
    file: "trend.csv",
    content: Buffer.from(
      `\uFEFF${lines(["Zeitstempel;Füllstand [m]"], (k) => [
        `2026-10-25 02:30:0${COUNT - 1 - k}+01:00;${comma(flow(COUNT - 1 - k))}`,
      ])}`,
      "utf16le",
    ),
    notes: "the newest row came first",
    steps: [],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: {
      start: "2026-10-25T01:30:00Z",
      time: INSTANTS,
      signals: { Füllstand: signal(FLOWS, ["m", 1]) },
    },
  },
  {
    name: "a packed text of which another column is the time",
    file: "packed.csv.gz",
    content: zlib.gzipSync(
      lines(["sample;elapsed [s];flow [l/min]"], (k) => [`${k + 1};${(k / 10).toFixed(1)};${flow(k)}`]),
    ),
    asks: "sample counts samples",
    steps: [
      ["choose", "Role of column 2", "Time"],
      ["choose", "Role of column 1", "Left out"],
    ],
    roles: ["Left out", "Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: { time: TENTHS, signals: { flow: signal(FLOWS, LITRES) } },
  },
  {
    name: "a line that no table has",
    file: "restarted.csv",
    content: lines(["t [s];flow [l/min]"], (k) => [
      `${comma(k / 10, 1)};${comma(flow(k))}`,
      ...(k === 1 ? ["restarted;by;hand"] : []),
    ]),
    asks: "3 fields where the header has 2",
    steps: [["press", "Lines to leave out: 4"]],
    roles: ["Time", "Signal"],
    read: "titles in line 1, samples from line 2 on; semicolons separate the columns",
    truth: { time: TENTHS, signals: { flow: signal(FLOWS, LITRES) } },
  },
  {
    name: "a workbook whose samples stand behind its cover",
    file: "cover.xlsx",
    content: fs.readFileSync(
      new URL("../../crates/recording/tests/payloads/excel/nasty.xlsx", import.meta.url),
    ),
    asks: "a time column and at least one signal column are needed",
    steps: [["choose", "Worksheet", "samples"], ZONE],
    roles: ["Time", "Tag (name of the signal)", "Value", "Quality"],
    place: "Worksheet samples, read as",
    read: "titles in line 1, samples from line 2 on",
    truth: {
      start: "2026-03-02T08:15:00Z",
      time: [0, 1, 2, 3, 4, 5],
      signals: {
        valve: signal([0, 0, 2, null, 2, 1], PLAIN),
        pressure: signal([1.5, 1.75, 2.25, 3.5, 3.25, 3], PLAIN),
      },
    },
  },
];
