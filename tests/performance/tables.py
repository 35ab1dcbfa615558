# SPDX-License-Identifier: Apache-2.0
"""The tables and pictures of docs/performance.md, each made of figures.Figures."""

import curves
from figures import CAPTURES

PRIORS = {"lidar": "lidar alone", "wheels_gyro": "wheels and gyro"}


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def ms(value):
    """Formats milliseconds with two or three significant digits."""
    return f"{value:.3f} ms" if value < 1 else f"{value:.2f} ms" if value < 10 else f"{value:.0f} ms"


def times(value):
    return f"{value:.2f}" if value < 10 else f"{value:.0f}"


def machine(f):
    m = f.machine
    others = m["others_cpus"]
    quiet = "Nothing else ran" if others < 0.05 else f"Other work took {others:.1f} of the CPUs in the mean"
    return (f"{m['cpus']} virtual CPUs of an {m['cpu']}, instructions `{f.context['isa']}`; {f.context['compiler']}, preset "
            f"`release`; PCL {f.context['pcl']}. {quiet} while this was measured, which took {m['took_s'] / 60:.0f} minutes; "
            f"load average at the start {m['load_before']:.1f}. Medians of {f.context['repetitions']} repetitions in random "
            "order.")


def pipeline(f):
    rows = []
    for name in f.captures():
        pcl = f.cpu_ms(f"pcl_gicp/{name}")
        row = [CAPTURES[name], ms(pcl)]
        for prior in PRIORS:
            run = f"pipeline/{name}/{prior}"
            row += [ms(f.cpu_ms(run)), f"1/{pcl / f.cpu_ms(run):.0f}"] if f.has(run) else ["", ""]
        rows.append(row)
    return table(["recording", "PCL's GICP", "locus, lidar alone", "ratio", "with wheels and gyro", "ratio"], rows)


def stage_row(f, name, stage, prior, floor, pcl=None):
    ours = sum(f.counter(f"pipeline/{name}/{prior}", f"{part}_ms") for part in stage.split("+"))
    return [f"`{stage.replace('+', '`, `')}`", ms(ours), ms(floor), times(ours / floor),
            ms(f.cpu_ms(pcl)) if pcl else "", f"1/{f.cpu_ms(pcl) / ours:.0f}" if pcl else ""]


def stages(f):
    """Table of the stages in the plant; scan-to-scan runs only at the start."""
    name, aided = "plant", "pipeline/plant/wheels_gyro"
    packets, points, one_pass = (f.cpu_ms(f"floor_{kind}/{name}") for kind in ("packets", "points", "pass"))
    rows = [
        stage_row(f, name, "decode", "wheels_gyro", packets),
        stage_row(f, name, "correct+filter", "wheels_gyro", packets + points, f"pcl_voxel_grid/{name}"),
        stage_row(f, name, "covariance", "wheels_gyro", points, f"pcl_normals/{name}"),
        stage_row(f, name, "scan_to_submap", "wheels_gyro", one_pass * f.counter(aided, "scan_to_submap_iterations")),
        stage_row(f, name, "map", "wheels_gyro", points * f.counter(aided, "keyframes")),
    ]
    return table(["stage, plant", "locus", "its floor", "relative to the floor", "PCL", "ratio"], rows)


def floors(f):
    rows = [[CAPTURES[name], *(f"{1e3 * f.cpu_ms(f'floor_{kind}/{name}'):.1f} µs" for kind in ("packets", "points", "pass")),
             f"{f.counter(f'pipeline/{name}/lidar', 'returns'):.0f}", f"{f.counter(f'floor_pass/{name}', 'points'):.0f}"]
            for name in f.captures()]
    return table(["recording", "bytes of the packets", "points after the filter", "one pass", "returns", "points registered"], rows)


def decoder(f):
    rows = []
    for model in dict.fromkeys(rest[0] for rest in f.named("decode")):
        row = [model]
        for mode in ("strongest", "dual"):
            ns, copy = (1e9 * f.counter(f"{what}/{model}/{mode}", "s_per_return") for what in ("decode", "memcpy"))
            row += [f"{ns:.1f} ns", f"{copy:.2f} ns", f"{f.counter(f'decode/{model}/{mode}', 'lidars_per_core'):.0f}"]
        rows.append(row)
    return table(["model", "per return, strongest", "memcpy of its bytes", "lidars per core", "per return, dual", "memcpy of its bytes",
                  "lidars per core"], rows)


def lidars(f):
    rows = []
    for name, words in [("vlp16_1", "one VLP-16"), ("vlp16_2", "two"), ("vlp16_3", "three"), ("vls128_1", "one VLS-128")]:
        row = [words, f"{f.counter(f'lidars/{name}/lidar', 'returns') / 1e3:.0f} k"]
        for prior in PRIORS:
            cost = f.cpu_ms(f"lidars/{name}/{prior}")
            row += [ms(cost), times(cost / f.cpu_ms(f"lidars/vlp16_1/{prior}"))]
        rows.append(row + [f"{f.counter(f'lidars/{name}/wheels_gyro', 'memory_mb'):.0f} MB"])
    return table(["lidars", "returns", "lidar alone", "relative to one", "with wheels and gyro", "relative to one", "memory"], rows)


def points(f):
    rows = []
    for rest in f.named("points"):
        if rest[1] == "lidar":
            alone, aided = f"points/{rest[0]}/lidar", f"points/{rest[0]}/wheels_gyro"
            rows.append([f"{f.counter(aided, 'points'):.0f}", ms(f.cpu_ms(alone)), ms(f.cpu_ms(aided)),
                         ms(f.counter(aided, "after_cut_ms")), f"{f.counter(aided, 'memory_mb'):.0f} MB"])
    return table(["points registered", "lidar alone", "with wheels and gyro", "of that after the cut", "memory"], rows)


def maps(f):
    rows = [[f"{f.counter(run, 'map_points') / 1e3:.0f} k", f"{rest[0]} MB", f"{f.counter(run, 'voxels') / 1e3:.0f} k",
             ms(f.cpu_ms(run)), ms(f.counter(run, "insert_ms"))]
            for rest in f.named("map") for run in ["/".join(["map", *rest])]]
    return table(["points inserted", "`map.max_bytes`", "voxels", "registering a sweep", "inserting it"], rows)


def speed_up(f, what, threads):
    return f.wall_ms(f"{what}/1") / f.wall_ms(f"{what}/{threads}")


THREADED = {"threads_spin/0": "the machine: a loop without memory", "threads_register/2000": "registration, 2000 points",
            "threads_register/10000": "registration, 10 000 points"}


def threads(f):
    rows = [[words, ms(f.wall_ms(f"{what}/1"))] + [times(speed_up(f, what, n)) for n in (2, 3, 4)]
            for what, words in THREADED.items()]
    return table(["work", "one thread, wall clock", "speedup with 2 threads", "3", "4"], rows)


def ratio(summary):
    return summary["process_cpu_ms"]["p99"] / summary["process_cpu_ms"]["p50"]


def drives(f):
    rows = []
    for d in f.drives:
        s = d["summary"]
        cost, p50 = 1e3 * s["cpu_s"] / s["sweeps"]["seen"], s["process_cpu_ms"]["p50"]
        rows.append([f"{d['world']}, {d['lidars']} VLP-16", ms(cost), ms(p50), ms(s["process_cpu_ms"]["p99"]), times(ratio(s)),
                     f"{100 * p50 / cost:.0f} %", f"{s['peak_rss_mb']:.0f} MB"])
    return table(["drive", "CPU per sweep", "from the cut, median", "99th percentile", "relative to the median",
                  "median, share of the CPU", "peak memory"], rows)


def goals(f):
    """Table of the project's goals and their measured values."""
    def after_cut(name):
        return f.counter(name, "after_cut_ms") / f.cpu_ms(name)

    def row(goal, value, holds, words):
        return [goal, words.format(value), "yes" if holds else "**no**"]

    pcl = [(f.cpu_ms(f"pipeline/{name}/lidar") / f.cpu_ms(f"pcl_gicp/{name}"), CAPTURES[name]) for name in f.captures()]
    decoding = max(1e9 * f.counter(f"decode/{'/'.join(rest)}", "s_per_return") for rest in f.named("decode"))
    p99 = max((ratio(d["summary"]), f"{d['world']}, {d['lidars']} VLP-16") for d in f.drives)
    rows = [row("a twentieth of PCL's GICP, lidar alone, on every recording", 1 / max(pcl)[0], max(pcl)[0] <= 1 / 20,
                "at most 1/{:.0f} (" + max(pcl)[1] + ")"),
            row("15 ns to decode a return", decoding, decoding <= 15, "{:.1f} ns at most")]
    for prior, words in PRIORS.items():
        two = f.cpu_ms(f"lidars/vlp16_2/{prior}") / f.cpu_ms(f"lidars/vlp16_1/{prior}")
        rows.append(row(f"two lidars at most 1.6 times one, {words}", two, two <= 1.6, "{:.2f}"))
    for what in ("threads_register/2000", "threads_register/10000"):
        two = speed_up(f, what, 2)
        rows.append(row(f"two threads 1.5 times as fast: {THREADED[what]}", two, two >= 1.5,
                        "{:.2f}; the machine gives " + times(speed_up(f, "threads_spin/0", 2))))
    rows.append(row("99 % of the sweeps within twice the median, from the cut", p99[0], p99[0] <= 2, "{:.1f} (" + p99[1] + ")"))
    for prior, words in PRIORS.items():
        share = 100 * after_cut(f"pipeline/plant/{prior}")
        rows.append(row(f"at most 60 % of the work after the cut, plant, {words}", share, share <= 60, "{:.0f} %"))
    return table(["goal", "measured", "holds"], rows)


def hours(f):
    """Table of the first minutes, and of the last, compared with a fresh start there."""
    def row(words, lines, who, held):
        median = sorted(line[who]["p50_ms"] for line in lines)[len(lines) // 2]
        return [words, ms(median), ms(max(line[who]["p99_ms"] for line in lines)), *held]
    def held(line):
        return [f"{line['path_m']} m", f"{line['memory_mb']:.1f} MB", f"{line['voxels'] / 1e3:.0f} k"]
    last = [line for line in f.long_drive if line["fresh"]]
    first, begin, end = f.long_drive[:len(last)], f.long_drive[-len(last) - 1], f.long_drive[-1]
    part = f"minutes {begin['minute']:.0f} to {end['minute']:.0f}"
    rows = [row(f"minutes 0 to {first[-1]['minute']:.0f}", first, "whole", held(first[-1])),
            row(part, last, "whole", held(end)), row(f"{part}, started there with an empty map", last, "fresh", ["", "", ""])]
    return table(["", "from the cut, median", "99th percentile of the worst minute", "driven", "memory held", "voxels"], rows)


def simulator(f):
    rows = [[d["world"], d["lidars"], f"{d['simulating_s']:.1f} s", f"{d['seconds'] / d['simulating_s']:.0f}"] for d in f.drives]
    return table(["world", "lidars", f"CPU of {f.drives[0]['seconds']} s", "times faster than real time"], rows)


def draw_points(f):
    def line(prior, figure):
        return f.line("points", lambda rest: int(rest[0]) if rest[1] == prior else None, figure)
    return curves.chart({"lidar alone": line("lidar", f.cpu_ms), "with wheels and gyro": line("wheels_gyro", f.cpu_ms),
                         "of that after the cut": line("wheels_gyro", lambda run: f.counter(run, "after_cut_ms"))},
                        "registered points per sweep of a VLS-128", "CPU per sweep, ms", log_x=True, log_y=True)


def draw_lidars(f):
    def line(prior):
        return f.line("lidars", lambda rest: int(rest[0][-1]) if rest[0].startswith("vlp16") and rest[1] == prior else None,
                      f.cpu_ms)
    one = line("wheels_gyro")[0][1]
    return curves.chart({"lidar alone": line("lidar"), "with wheels and gyro": line("wheels_gyro"),
                         "goal: 0.6 of one for each further one": [(n, one * (1 + 0.6 * (n - 1))) for n in (1, 2, 3)]},
                        "VLP-16 on the robot", "CPU per sweep, ms")


def draw_maps(f):
    def line(size, figure):
        return f.line("map", lambda rest: int(rest[1]) if rest[0] == size else None, figure)
    sizes = dict.fromkeys(rest[0] for rest in f.named("map"))
    series = {f"registering, {size} MB": line(size, f.cpu_ms) for size in sizes}
    series |= {f"inserting, {size} MB": line(size, lambda run: f.counter(run, "insert_ms")) for size in sizes}
    return curves.chart(series, "points inserted into the map", "CPU per sweep, ms", log_x=True)


def draw_threads(f):
    series = {words: [(n, speed_up(f, what, n)) for n in (1, 2, 3, 4)] for what, words in THREADED.items()}
    return curves.chart(series, "threads", "speedup")


def draw_hours(f):
    def line(who, key):
        return [(line["minute"], line[who][key]) for line in f.long_drive if line[who]]
    return curves.chart({"median of the minute": line("whole", "p50_ms"), "99th percentile": line("whole", "p99_ms"),
                         "median, started there with an empty map": line("fresh", "p50_ms")}, "minutes of driving",
                        "CPU per sweep from its cut, ms")


def draw_memory(f):
    return curves.chart({"memory held": [(line["minute"], line["memory_mb"]) for line in f.long_drive]}, "minutes of driving",
                        "MB")


BLOCKS = {"machine": machine, "goals": goals, "pipeline": pipeline, "stages": stages, "floors": floors, "decoder": decoder,
          "points": points, "lidars": lidars, "maps": maps, "threads": threads, "drives": drives, "hours": hours,
          "simulator": simulator}
PICTURES = {"points": draw_points, "lidars": draw_lidars, "maps": draw_maps, "threads": draw_threads, "hours": draw_hours,
            "memory": draw_memory}
