"""Tables as Excel saves them as text in further locales."""

from zoneinfo import ZoneInfo

from payloads import TOKYO, Family, bracketed, stamp, table, wide


def elsewhere():
    """Excel in other locales."""
    family = Family("excel_csv_elsewhere")
    t = table(begin=table().begin.replace(month=4, day=23))
    ascii_units = table(begin=t.begin, units=("bar", "°C", "m3/h"))

    def locale(
        name,
        level,
        form,
        zone,
        answers,
        separator=";",
        mark=",",
        title="Time",
        encoding="utf-8",
        grouping="",
        missing="",
        data=t,
        titles="{name} [{unit}]",
        must=("tz",),
    ):
        body = wide(
            data,
            lambda row: stamp(data.clock(row), form, zone),
            bracketed(data, titles),
            separator,
            mark,
            grouping=grouping,
            missing=missing,
            time_title=title,
            end="\r\n",
        )
        family.add(name, level, body, data.truth(), answers=answers, encoding=encoding, must_ask=must)

    paris, london, stockholm = ZoneInfo("Europe/Paris"), ZoneInfo("Europe/London"), ZoneInfo("Europe/Stockholm")
    zurich, amsterdam = ZoneInfo("Europe/Zurich"), ZoneInfo("Europe/Amsterdam")
    locale(
        "france",
        "clean",
        "%d/%m/%Y %H:%M:%S",
        paris,
        {"tz": "Europe/Paris", "time_unit": "dmy", "encoding": "windows-1252"},
        title="Horodatage",
        encoding="cp1252",
    )
    large = table("SC104 LT105", begin=t.begin)
    locale(
        "france_thousands",
        "nasty",
        "%d/%m/%Y %H:%M:%S",
        paris,
        {"tz": "Europe/Paris", "time_unit": "dmy"},
        title="Date",
        grouping="\u202f",
        data=large,
    )
    locale(
        "switzerland_thousands",
        "nasty",
        "%d.%m.%Y %H:%M:%S",
        zurich,
        {"tz": "Europe/Zurich"},
        mark=".",
        grouping="'",
        data=large,
        title="Zeit",
    )
    locale(
        "netherlands",
        "typical",
        "%-d-%-m-%Y %H:%M:%S",
        amsterdam,
        {"tz": "Europe/Amsterdam", "time_unit": "dmy"},
        title="Tijd",
    )
    locale("britain", "typical", "%d/%m/%Y %H:%M:%S", london, {"tz": "Europe/London", "time_unit": "dmy"}, ",", ".")
    locale("sweden", "clean", "%Y-%m-%d %H:%M:%S", stockholm, {"tz": "Europe/Stockholm"}, title="Tid")
    locale(
        "japan",
        "typical",
        "%Y/%m/%d %H:%M:%S",
        TOKYO,
        {"tz": "Asia/Tokyo", "encoding": "shift_jis"},
        ",",
        ".",
        title="日時",
        encoding="cp932",
        data=ascii_units,
    )
    locale(
        "china",
        "typical",
        "%Y年%m月%d日 %H:%M:%S",
        ZoneInfo("Asia/Shanghai"),
        {"tz": "Asia/Shanghai", "encoding": "gbk"},
        ",",
        ".",
        title="时间",
        encoding="gbk",
        data=ascii_units,
    )
    locale(
        "korea",
        "nasty",
        "%Y-%m-%d %p %-I:%M:%S",
        ZoneInfo("Asia/Seoul"),
        {"tz": "Asia/Seoul"},
        ",",
        ".",
        title="시간",
    )
    locale(
        "poland",
        "typical",
        "%Y-%m-%d %H:%M:%S",
        ZoneInfo("Europe/Warsaw"),
        {"tz": "Europe/Warsaw", "encoding": "windows-1250"},
        title="Czas próbki",
        encoding="cp1250",
        data=ascii_units,
    )
    locale(
        "russia",
        "typical",
        "%d.%m.%Y %H:%M:%S",
        ZoneInfo("Europe/Moscow"),
        {"tz": "Europe/Moscow", "encoding": "windows-1251"},
        title="Время",
        encoding="cp1251",
        data=ascii_units,
    )
    locale(
        "brazil",
        "typical",
        "%d/%m/%Y %H:%M:%S",
        ZoneInfo("America/Sao_Paulo"),
        {"tz": "America/Sao_Paulo", "time_unit": "dmy"},
        title="Data/Hora",
    )
    locale(
        "italy_dots",
        "typical",
        "%d/%m/%Y %H.%M.%S",
        ZoneInfo("Europe/Rome"),
        {"tz": "Europe/Rome", "time_unit": "dmy"},
        title="Data e ora",
    )
    locale(
        "finland",
        "typical",
        "%-d.%-m.%Y %-H.%M.%S",
        ZoneInfo("Europe/Helsinki"),
        {"tz": "Europe/Helsinki"},
        title="Aika",
    )
    locale(
        "denmark",
        "typical",
        "%d-%m-%Y %H:%M:%S",
        ZoneInfo("Europe/Copenhagen"),
        {"tz": "Europe/Copenhagen", "time_unit": "dmy"},
        title="Tid",
    )
    early = table(begin=t.begin.replace(month=4, day=3))
    locale(
        "day_or_month",
        "nasty",
        "%d/%m/%Y %H:%M:%S",
        london,
        {"tz": "Europe/London", "time_unit": "dmy"},
        ",",
        ".",
        data=early,
        must=("tz", "time_unit"),
    )
    return family.variants


def variants():
    return elsewhere()
