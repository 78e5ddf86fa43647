"""A device whose circuit answers at once: pressures by eq. 3 at rest, pulsation on top. Closed forms for tests of the alarms."""

import numpy as np

from pipeline.recording import Channel, Recording, Stream

ML_MIN = 1e-6 / 60.0
R = {"access": 1.4e9, "filter": 1.2e9, "return": 1.4e9}
K_UF = 2.0835e-11


def device(
    duration=400.0,
    rate=20.0,
    flow=80.0,
    uf=5.0,
    start=20.0,
    stops=(),
    factors=(),
    frequency=1.958,
    offsets=(-60.0, 80.0, 40.0, -30.0),
    skew=0.0,
    seed=0,
    tables=None,
    conditions=None,
    flow_at=None,
    uf_runs=None,
    told=("blood_flow_set", "uf_pump_command"),
    noise=15.0,
):
    """Return a recording; `factors` are (what, factor, from, to) with what in access, filter, return, membrane."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 1.0 / rate)
    on = t >= start
    for a, b in stops:
        on &= ~((t >= a) & (t < b))
    set_flow = np.full(t.size, float(flow)) if flow_at is None else flow_at(t)
    q = set_flow * ML_MIN * on
    u = uf * ML_MIN * (on if uf_runs is None else uf_runs(t, on))
    many = {name: np.ones(t.size) for name in (*R, "membrane")}
    for what, factor, a, b in factors:
        many[what][(t >= a) & (t < b)] = factor
    back = R["return"] * many["return"] * (q - u * on)
    pre = back + R["filter"] * many["filter"] * (q - 0.5 * u * on)
    tmp = np.empty(t.size)
    tmp[0], goal, keep = 0.0, u / K_UF * many["membrane"], np.exp(-1.0 / (1.44 * rate))
    for i in range(1, t.size):
        tmp[i] = keep * tmp[i - 1] + (1.0 - keep) * goal[i]
    levels = {
        "access": -R["access"] * many["access"] * q,
        "prefilter": pre,
        "return": back,
        "uf": 0.5 * (pre + back) - tmp,
    }
    channels = {}
    for (tap, level), offset, pulse in zip(levels.items(), offsets, (500.0, 800.0, 450.0, 20.0), strict=True):
        common = 20.0 * rng.standard_normal(t.size)
        for unit, late in (("rap", 0.0), ("prot", skew)):
            wave = pulse * np.cos(2.0 * np.pi * frequency * (t + late)) * on
            read = level + wave + offset + common + noise * rng.standard_normal(t.size)
            name = f"pressure_{tap}_{unit}"
            channels[name] = Channel(name, np.round(read / 26.0) * 26.0, "Pa")
    status = {
        "blood_flow_set": set_flow * ML_MIN * on,
        "uf_pump_command": u,
        "uf_flow_set": np.full(t.size, uf * ML_MIN),
    }
    channels |= {name: Channel(name, status[name], "m^3/s") for name in told}
    streams = {"device": Stream("device", t, channels), **(tables or {})}
    return Recording("run", streams, conditions or {})


def events(*rows):
    """Return a list of events: rows of (time, channel, word)."""
    rows = sorted(rows)
    names = list(dict.fromkeys(row[1] for row in rows))
    time = np.array([row[0] for row in rows], float) + 1e-6 * np.arange(len(rows))
    columns = {
        name: Channel(name, np.array([row[2] if row[1] == name else None for row in rows], object), "")
        for name in names
    }
    return Stream("events", time, columns)


def flag(name, *times, duration=400.0):
    """Return a table of one flag that is 1 in each of the spans `times`."""
    t = np.arange(0.0, duration, 0.05)
    values = np.zeros(t.size)
    for a, b in times:
        values[(t >= a) & (t < b)] = 1.0
    return Stream(name, t, {name: Channel(name, values, "1")})


def with_channel(recording, name, change):
    """Return the recording with a channel of its device table put through `change(time, values)`."""
    stream = recording.streams["device"]
    values = change(stream.time, stream.channels[name].values.copy())
    channels = {**stream.channels, name: Channel(name, values, stream.channels[name].unit)}
    return Recording(recording.run, {**recording.streams, "device": Stream("device", stream.time, channels)}, {})


def without(recording, *names):
    """Return the recording without some channels of its device table."""
    stream = recording.streams["device"]
    channels = {name: channel for name, channel in stream.channels.items() if name not in names}
    return Recording(recording.run, {**recording.streams, "device": Stream("device", stream.time, channels)}, {})
