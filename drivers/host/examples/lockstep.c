/* SPDX-License-Identifier: MIT */
/* A car that drives in a simulator, and a scanner head on its roof, in lock-step.
 *
 *     lockstep SOURCE [STEPS]          SOURCE: tcp:HOST:PORT, tty:PATH
 *
 * The simulator owns time and pose: it grants one millisecond after the other, each with the car's pose at its end. All
 * points whose pulse was fired in that millisecond come before the grant's reply. The head runs with
 * config/lockstep.yaml.
 *
 * A simulator of your own needs two functions: grant(), with your car instead of car_at(), and take(), with your use of
 * the points. The rest checks that each pulse comes once and within its step, and that each point lies where the exact
 * pose puts it. */
#include <math.h>
#include <scanhead.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STEP_NS INT64_C(1000000)
#define PI      3.14159265358979323846

/* The car drives clockwise on a circle about the middle of the street. The head is on the car's roof, in front of the
 * car's middle. The walls are at x = +-20 m (lockstep.yaml, street.obj). */
static const double SPEED_M_S = 5.0, RADIUS_M = 8.0, MOUNT_M[3] = {0.0, 0.5, 1.8}, WALL_M = 20.0;

/* The largest error of a point: the head takes the car along a chord of 1 ms (speed^2 / radius * step^2 / 8: 0.39 um);
 * ranges are rounded to 1 um (0.5 um); angles to 2^-32 turn, at up to 60 m (0.04 um); times to 1 ns (0.005 um). */
static const double TOLERANCE_M = 1e-6;

struct pose {
    double x_m, y_m, heading_rad; /* clockwise from the scene's y */
};

static struct pose car_at(int64_t t_ns)
{
    const double turned_rad = SPEED_M_S / RADIUS_M * 1e-9 * (double)t_ns;
    return (struct pose){RADIUS_M * sin(turned_rad), RADIUS_M * cos(turned_rad), turned_rad + PI / 2};
}

struct run {
    struct scanhead *sh;
    int64_t granted_ns; /* device time */
    int64_t begin_ns;   /* of the last step */
    int64_t scan_t0_ns; /* device time of the scan's start */
    uint64_t pulses, echoes, on_walls;
    uint64_t wrong; /* pulses that are missing, came twice, or in another step */
    double worst_m; /* distance of a point from its surface */
};

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "lockstep: %s: %s\n", what, why);
    exit(1);
}

static const char *tell(struct run *run, const char *line)
{
    static char reply[512];
    if (scanhead_command(run->sh, line, reply, sizeof reply, -1) != SCANHEAD_OK) fail(line, scanhead_error(run->sh));
    if (strncmp(reply, "ERR", 3) == 0) fail(line, reply);
    return reply;
}

/* Lets a millisecond pass. Meanwhile the car goes to its place at the end of it. */
static void grant(struct run *run)
{
    char line[160];
    run->begin_ns = run->granted_ns;
    run->granted_ns += STEP_NS;
    const struct pose car = car_at(run->granted_ns);
    snprintf(line, sizeof line, "TIME:STEP %lld NS, %.9f, %.9f, 0, 0, 0, %.9f", (long long)STEP_NS, car.x_m, car.y_m,
             remainder(car.heading_rad, 2 * PI) * 180 / PI);
    tell(run, line);
}

/* Takes a point from the head's frame to the scene by the exact pose of its time, and looks how far it is from the
 * nearest surface: ground, left or right wall. */
static void check_place(struct run *run, const struct scanhead_point *p, int64_t t_ns)
{
    const struct pose car = car_at(t_ns);
    const double c = cos(car.heading_rad), s = sin(car.heading_rad);
    const double right_m = p->x + MOUNT_M[0], forward_m = p->y + MOUNT_M[1];
    const double x_m = car.x_m + c * right_m + s * forward_m, z_m = p->z + MOUNT_M[2];
    const double wall_m = fabs(fabs(x_m) - WALL_M), off_m = fmin(wall_m, fabs(z_m));
    if (off_m > run->worst_m) run->worst_m = off_m;
    run->on_walls += wall_m <= TOLERANCE_M;
    run->echoes++;
}

static void take_points(struct run *run, const struct scanhead_frame *frame)
{
    struct scanhead_point point[256];
    uint64_t pulses = 0;
    if (frame->pulse0 != run->pulses) run->wrong++;
    for (uint32_t first = 0; first < frame->n_points;) {
        const int n = scanhead_points(run->sh, frame, first, point, 256);
        if (n <= 0) fail("points", scanhead_error(run->sh));
        for (int i = 0; i < n; i++) {
            const int64_t t_ns = run->scan_t0_ns + point[i].t_ns;
            run->wrong += t_ns < run->begin_ns || t_ns >= run->granted_ns;
            pulses += point[i].echo <= 1; /* 0: nothing was hit; 2 and more: another echo of the same pulse */
            if (point[i].echo != 0) check_place(run, &point[i], t_ns);
        }
        first += (uint32_t)n;
    }
    run->wrong += pulses != frame->n_pulses;
    run->pulses = frame->pulse0 + frame->n_pulses;
}

/* Takes all that came with the last grant. Nothing more of it will come, so this does not wait. */
static void take(struct run *run)
{
    struct scanhead_frame frame;
    while (scanhead_next(run->sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_EVENT && frame.event == SCANHEAD_EV_SCAN_START)
            run->scan_t0_ns = (int64_t)frame.event_value[1];
        if (frame.type == SCANHEAD_POINTS) take_points(run, &frame);
    }
}

static double now_s(void)
{
    struct timespec t;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    struct run run = {0};
    char err[256];
    const long steps = argc > 2 ? strtol(argv[2], NULL, 10) : 1000;
    if (argc < 2 || steps < 100) fail("usage", "lockstep SOURCE [STEPS, 100 or more]");
    if (scanhead_open(argv[1], &run.sh, err, sizeof err) != SCANHEAD_OK) fail(argv[1], err);
    run.granted_ns = strtoll(tell(&run, "TIME?"), NULL, 10);
    while (strcmp(tell(&run, "HEAD:STATe?"), "idle") != 0) /* its boot takes device time */
        grant(&run);
    tell(&run, "SCAN:STARt");
    const double start_s = now_s();
    for (long i = 0; i < steps; i++) {
        grant(&run);
        take(&run);
    }
    const double wall_s = now_s() - start_s;
    const uint64_t pulses = run.pulses;
    grant(&run);
    take(&run); /* a late pulse of the last step would come now */
    tell(&run, "SCAN:STOP");
    scanhead_close(run.sh);
    printf("%ld steps of 1 ms, %llu pulses, %llu echoes, %llu of them on the walls\n", steps,
           (unsigned long long)pulses, (unsigned long long)run.echoes, (unsigned long long)run.on_walls);
    printf("largest distance from a surface %.2g um; measured here: %.0f steps per second\n", 1e6 * run.worst_m,
           (double)steps / wall_s);
    if (run.wrong != 0) fail("pulses", "some are missing, came twice, or not within their step");
    if (!(run.worst_m <= TOLERANCE_M)) fail("points", "some are farther than 1 um from where the pose puts them");
    if (run.on_walls == 0) fail("points", "none are on the walls");
    return 0;
}
