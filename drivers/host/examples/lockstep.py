# SPDX-License-Identifier: MIT
"""A car that drives in a simulator, and a scanner head on its roof, in lock-step.

    PYTHONPATH=drivers/host/python python3 lockstep.py SOURCE [STEPS]     SOURCE: tcp:HOST:PORT, tty:PATH

The simulator owns time and pose: it grants one millisecond after the other, each with the car's pose at its end.
All points whose pulse was fired in that millisecond come before the grant's reply. The head runs with
config/lockstep.yaml.

A simulator of your own needs two functions: grant(), with your car instead of car_at(), and take(), with your use of
the points. The rest checks that each pulse comes once and within its step, and that each point lies where the exact
pose puts it.
"""
import math
import sys
import time

import scanhead

STEP_NS = 1_000_000

# The car drives clockwise on a circle about the middle of the street. The head is on the car's roof, in front of the
# car's middle. The walls are at x = +-20 m (lockstep.yaml, street.obj).
SPEED_M_S, RADIUS_M, MOUNT_M, WALL_M = 5.0, 8.0, (0.0, 0.5, 1.8), 20.0

# The largest error of a point: the head takes the car along a chord of 1 ms (speed^2 / radius * step^2 / 8: 0.39 um);
# ranges are rounded to 1 um (0.5 um); angles to 2^-32 turn, at up to 60 m (0.04 um); times to 1 ns (0.005 um).
TOLERANCE_M = 1e-6


def car_at(t_ns):
    """x and y in the scene, m, and the heading clockwise from y, rad."""
    turned_rad = SPEED_M_S / RADIUS_M * 1e-9 * t_ns
    return RADIUS_M * math.sin(turned_rad), RADIUS_M * math.cos(turned_rad), turned_rad + math.pi / 2


class Run:
    def __init__(self, head):
        self.head = head
        self.begin_ns = self.granted_ns = int(head.command("TIME?"))  # of the last step, device time
        self.scan_t0_ns = 0
        self.pulses = self.echoes = self.on_walls = 0
        self.wrong = 0  # pulses that are missing, came twice, or in another step
        self.worst_m = 0.0  # distance of a point from its surface

    def grant(self):
        """Lets a millisecond pass. Meanwhile the car goes to its place at the end of it."""
        self.begin_ns, self.granted_ns = self.granted_ns, self.granted_ns + STEP_NS
        x_m, y_m, heading_rad = car_at(self.granted_ns)
        heading_deg = math.degrees(math.remainder(heading_rad, math.tau))
        self.head.command(f"TIME:STEP {STEP_NS} NS, {x_m:.9f}, {y_m:.9f}, 0, 0, 0, {heading_deg:.9f}")

    def take(self):
        """Takes all that came with the last grant. Nothing more of it will come, so this does not wait."""
        while True:
            try:
                frame = self.head.next_frame(timeout_s=0)
            except scanhead.Timeout:
                return
            if frame.is_event(scanhead.EV_SCAN_START):
                self.scan_t0_ns = frame.fields["b"]
            if frame.type == scanhead.POINTS:
                self.take_points(frame)

    def take_points(self, frame):
        points, pulses = self.head.points(frame), 0
        self.wrong += frame.fields["pulse0"] != self.pulses
        for x_m, y_m, z_m, since_ns, echo in zip(points.x, points.y, points.z, points.t_ns, points.echo):
            t_ns = self.scan_t0_ns + int(since_ns)
            self.wrong += not self.begin_ns <= t_ns < self.granted_ns
            pulses += int(echo <= 1)  # 0: nothing was hit; 2 and more: another echo of the same pulse
            if echo != 0:
                self.check_place(x_m, y_m, z_m, t_ns)
        self.wrong += pulses != frame.fields["n_pulses"]
        self.pulses = frame.fields["pulse0"] + frame.fields["n_pulses"]

    def check_place(self, x_m, y_m, z_m, t_ns):
        """Takes a point from the head's frame to the scene by the exact pose of its time, and looks how far it is
        from the nearest surface: ground, left or right wall."""
        car_x_m, _, heading_rad = car_at(t_ns)
        right_m, forward_m = x_m + MOUNT_M[0], y_m + MOUNT_M[1]
        scene_x_m = car_x_m + math.cos(heading_rad) * right_m + math.sin(heading_rad) * forward_m
        wall_m = abs(abs(scene_x_m) - WALL_M)
        self.worst_m = max(self.worst_m, min(wall_m, abs(z_m + MOUNT_M[2])))
        self.on_walls += wall_m <= TOLERANCE_M
        self.echoes += 1


def main(source, steps):
    with scanhead.open(source) as head:
        run = Run(head)
        while head.command("HEAD:STATe?") != "idle":  # it boots only while granted time passes
            run.grant()
        head.command("SCAN:STARt")
        start_s = time.monotonic()
        for _ in range(steps):
            run.grant()
            run.take()
        wall_s, pulses = time.monotonic() - start_s, run.pulses
        run.grant()
        run.take()  # a late pulse of the last step would come now
        head.command("SCAN:STOP")
    print(f"{steps} steps of 1 ms, {pulses} pulses, {run.echoes} echoes, {run.on_walls} of them on the walls")
    print(f"largest distance from a surface {1e6 * run.worst_m:.2g} um; "
          f"measured here: {steps / wall_s:.0f} steps per second")
    if run.wrong:
        sys.exit("lockstep: pulses: some are missing, came twice, or not within their step")
    if not run.worst_m <= TOLERANCE_M:
        sys.exit("lockstep: points: some are farther than 1 um from where the pose puts them")
    if not run.on_walls:
        sys.exit("lockstep: points: none are on the walls")


if __name__ == "__main__":
    steps = sys.argv[2] if len(sys.argv) > 2 else "1000"
    if len(sys.argv) < 2 or not steps.isdecimal() or int(steps) < 100:
        sys.exit("usage: lockstep.py SOURCE [STEPS, 100 or more]")
    main(sys.argv[1], int(steps))
