#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""This measures processor time a pulse beside HELIOS++. Both write LAS, in turns on one processor.

HELIOS++ isn't part of this project: --helios names its program, --assets the folder that has its `data`. Both scan the
same mesh with the same lines, at 100 kHz, one thread. The time of a short scan is subtracted from that of a long
one, so that loading does not count. The work is not the same: HELIOS++ computes a waveform of each pulse, too."""
import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

SURVEY = """<?xml version="1.0" encoding="UTF-8"?>
<document>
 <scannerSettings id="p" active="true" pulseFreq_hz="100000" scanAngle_deg="{angle}"/>
 <survey name="s" scene="{folder}/scene.xml#s" platform="data/platforms.xml#tripod" scanner="data/scanners_tls.xml#riegl_vz400">
  <FWFSettings beamSampleQuality="{quality}"/>
  <leg>
   <platformSettings x="{at[0]}" y="{at[1]}" z="{base}" onGround="false"/>
   <scannerSettings template="p" verticalAngleMin_deg="{w.lowest_deg}" verticalAngleMax_deg="{w.highest_deg}"
    headRotateStart_deg="{w.pan_deg}" headRotateStop_deg="{stop}" verticalResolution_deg="{step}"
    horizontalResolution_deg="{w.line_deg}"/>
  </leg>
 </survey>
</document>
"""
SCENE = """<?xml version="1.0" encoding="UTF-8"?>
<document><scene id="s" name="s"><part><filter type="objloader">
<param type="string" key="filepath" value="{folder}/mesh.obj"/></filter></part></scene></document>
"""
CONFIG = """head: {{profile: riegl-vz2000i, prr_hz: 100000, frames: 1, {w.ours}}}
scene: {{meshes: [{{file: {folder}/mesh.obj, up: z, scale: 1}}]}}
stations: [{{name: middle, position_m: [{at[0]}, {at[1]}, {at[2]}], heading_deg: {heading}}}]
"""
TRIPOD_M = 1.7  # of HELIOS++: from its platform to its scanner
LINE_PULSES = 1000


class Window:
    """Lines go from lowest_deg to highest_deg, line_deg apart. HELIOS++ pans short_deg or long_deg, ours in sweeps."""

    def __init__(self, lowest_deg, highest_deg, pan_deg, line_deg, short_deg, long_deg, sweep_lines, ours):
        self.lowest_deg, self.highest_deg, self.pan_deg, self.line_deg = lowest_deg, highest_deg, pan_deg, line_deg
        self.short_deg, self.long_deg, self.sweep_lines, self.ours = short_deg, long_deg, sweep_lines, ours


ALL_ROUND = Window(-40, 60, 0, 0.36, 36, 144, 1000, "lines_hz: 41.666667, pan_deg_s: 15")
CROWNS = Window(-12, 16, -30, 0.12, 6, 24, 200, "lines_hz: 11.666667, pan_deg_s: 1.4, line_start_deg: -12, "
                "line_stop_deg: 16, pan_start_deg: 0, pan_stop_deg: 24")
# Each row has HELIOS++'s beamSampleQuality, the rays a pulse that both cast, and our options for as many.
BEAMS = [(1, 1, ["beam.mode=single"]), (3, 19, ["beam.mode=rings", "beam.rings=2"])]


def processor_s(command, cwd, core):
    pid = os.fork()
    if pid == 0:
        try:
            os.sched_setaffinity(0, {core})
            os.chdir(cwd)
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.execv(command[0], command)
        except OSError as e:
            print(f"helios.py: {command[0]}: {e.strerror}", file=sys.stderr)
            os._exit(127)
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        sys.exit(f"helios.py: {command[0]} failed; its output may say why: {' '.join(command)}")
    return usage.ru_utime + usage.ru_stime


def theirs_ns(o, folder, at, w, quality):
    took = []
    for pan_deg in (w.long_deg, w.short_deg):
        with open(f"{folder}/survey.xml", "w") as f:
            f.write(SURVEY.format(folder=folder, at=at, base=at[2] - TRIPOD_M, quality=quality, w=w,
                                  angle=w.highest_deg - w.lowest_deg, stop=w.pan_deg + pan_deg,
                                  step=(w.highest_deg - w.lowest_deg) / LINE_PULSES))
        shutil.rmtree(f"{folder}/out", ignore_errors=True)
        took.append(processor_s([o.helios, f"{folder}/survey.xml", "--assets", o.assets + "/", "--output",
                                 f"{folder}/out", "-j", "1", "--kdtJobs", "1", "--lasOutput", "--silent"],
                                o.assets, o.core))
    return 1e9 * (took[0] - took[1]) / ((w.long_deg - w.short_deg) / w.line_deg * LINE_PULSES)


def ours_ns(o, folder, w, sets):
    options = ["--set", "loop.threads=1"] + [word for s in sets for word in ("--set", s)]
    took = [processor_s([o.scanhead, "record", f"{folder}/scan.yaml", "-o", f"{folder}/ours.las", "--quiet",
                         "--frames", str(frames)] + options, folder, o.core) for frames in (4, 1)]
    return 1e9 * (took[0] - took[1]) / (3 * w.sweep_lines * LINE_PULSES)


def compare(o, scene, folder):
    w = CROWNS if scene == "foliage" else ALL_ROUND
    at = [float(x) for x in subprocess.run([o.write_mesh, scene, f"{folder}/mesh.obj"], check=True,
                                           capture_output=True, text=True).stdout.split()]
    for name, text in (("scene.xml", SCENE), ("scan.yaml", CONFIG)):
        with open(f"{folder}/{name}", "w") as f:
            f.write(text.format(folder=folder, at=at, w=w, heading=w.pan_deg % 360))
    for quality, rays, sets in BEAMS:
        pairs = [(theirs_ns(o, folder, at, w, quality), ours_ns(o, folder, w, sets)) for _ in range(o.rounds)]
        theirs, ours = (statistics.median(column) for column in zip(*pairs))
        print(f"{scene:10} {rays:5} {theirs:10.0f} {ours:10.1f} {statistics.median(t / u for t, u in pairs):7.1f}",
              flush=True)


def main():
    build = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../build")
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--helios", required=True, type=os.path.abspath, help="the program helios++")
    p.add_argument("--assets", required=True, type=os.path.abspath, help="the folder that has its data")
    p.add_argument("--scanhead", default=f"{build}/scanhead", type=os.path.abspath)
    p.add_argument("--write-mesh", default=f"{build}/tests/bench/write_mesh", type=os.path.abspath)
    p.add_argument("--scenes", default="100k,1M,foliage", help="names as in bench --scenes")
    p.add_argument("--rounds", default=3, type=int)
    p.add_argument("--core", default=0, type=int, help="the processor that all runs on")
    o = p.parse_args()
    print("scene       rays  HELIOS++   scanhead   ratio     ns a pulse; medians")
    for scene in o.scenes.split(","):
        with tempfile.TemporaryDirectory(prefix="scanhead-helios-") as folder:
            compare(o, scene, folder)


if __name__ == "__main__":
    main()
