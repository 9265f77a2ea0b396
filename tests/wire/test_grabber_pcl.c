/* SPDX-License-Identifier: MIT */
/* PCL's VLPGrabber, where PCL is installed. Turns are whole, and each point lies on the house. The grabber treats all
 * lasers of a firing sequence as fired at once. The test knows the laser by its elevation, and so its true time. */
#include "tests/wire/house.h"

/* On a busy machine the kernel drops packets that the client does not fetch in time. One run of RUNS has to be
 * whole. */
enum { SWEEPS = 3, RUNS = 5 };

/* The lasers in the order of firing, 2.304 us apart, at 3,600 degrees a second. */
static const double ELEVATION_DEG[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
static const double LASER_DEG = 2.304 * 3600e-6;

static int run_shell(struct wire *wire, const char *command)
{
    const char *const args[] = {"-c", command, NULL};
    return wire_wait(wire, wire_spawn_program(wire, "/bin/sh", args, "shell.out", "shell.err", -1));
}

/* Returns the client's program, or skips the test where it can't be had. Compiling PCL's headers takes most of this
 * test's time. So the program is kept beside the other readers while its source is the same. */
static const char *build_or_skip(struct wire *wire)
{
    static char program[512];
    char command[1600];
    const char *folder = getenv("READERS"), *own = wire_path(wire, "pcl_vlp16");
    if (run_shell(wire, "pkg-config --exists pcl_io && command -v g++") != 0) {
        print_message("PCL is not there: package libpcl-dev\n");
        skip();
    }
    snprintf(program, sizeof program, "%s/pcl_vlp16", folder != NULL ? folder : wire->dir);
    snprintf(command, sizeof command,
             "[ %s -nt tests/readers/pcl_vlp16.in ] || { g++ -O0 -w -x c++ tests/readers/pcl_vlp16.in -o %s.new "
             "$(pkg-config --cflags --libs pcl_io) && mv %s.new %s; }",
             program, own, own, program);
    if (run_shell(wire, command) != 0) {
        wire_show(wire, "shell.err");
        fail_msg("the client does not compile");
    }
    return program;
}

static int free_port(void)
{
    int port;
    close(wire_bind(SOCK_DGRAM, &port));
    return port;
}

/* Returns 1 when the point is on the house. */
static int is_right(const struct house *house, double x, double y, double z)
{
    const double range_m = sqrt(x * x + y * y + z * z), elevation = asin(z / range_m);
    int laser = -1;
    for (int i = 0; i < 16; i++) /* coordinates are printed to 10 um */
        if (fabs(elevation * 180.0 / M_PI - ELEVATION_DEG[i]) < 0.01) laser = i;
    if (laser < 0) fail_msg("no laser at %.4f degrees", elevation * 180.0 / M_PI);
    const double azimuth = atan2(x, y) + laser * LASER_DEG * M_PI / 180.0;
    /* The bound is half of 2 mm, and the printed digits. Azimuths are rounded to 0.01 degrees on the wire and once more
     * there. */
    return house_agrees(house, azimuth, ELEVATION_DEG[laser] * M_PI / 180.0, 0.02 * M_PI / 180.0, range_m, 0.00102, 0.1,
                        100.0);
}

/* Returns 1 when the turns are whole. */
static int check_sweeps(const struct house *house, const char *text)
{
    char *at = strstr(text, "sweep ");
    int checked = 0, wrong = 0, whole = 1;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        assert_non_null(at);
        const long n = strtol(at + strlen("sweep "), &at, 10);
        /* A turn has 0.1 s / 55.296 us = 1808.4 sequences, and a sweep begins with a block, which has two. All of them
         * meet something. The first sweep begins anywhere. */
        if (sweep > 0) {
            assert_true(n <= 16 * 1811);
            whole &= n >= 16 * 1806;
        }
        for (long i = 0; i < n; i++) {
            double x = strtod(at, &at), y = strtod(at, &at), z = strtod(at, &at);
            if (sweep == 0 || i % 4 != 0) continue;
            checked++;
            wrong += !is_right(house, x, y, z);
        }
        at = strstr(at, "sweep ");
    }
    /* Frames of windows have outlines that are closer together than the rounding of azimuths. */
    if (wrong > checked / 1000) fail_msg("%d of %d points are not on the house", wrong, checked);
    return whole;
}

static int run_whole(struct wire *wire, const char *program)
{
    char data[64], position[64], port[16];
    snprintf(port, sizeof port, "%d", free_port());
    snprintf(data, sizeof data, "links.0.port=%s", port);
    snprintf(position, sizeof position, "links.1.port=%d", free_port());
    const char *const more[] = {"--set", data, "--set", position, "--set", "links.2.port=0", NULL};
    char count[8];
    snprintf(count, sizeof count, "%d", SWEEPS);
    const char *const args[] = {port, count, NULL};
    pid_t client = wire_spawn_program(wire, program, args, "sweeps", "pcl.err", -1);
    struct head head = head_start(wire, "config/velodyne.yaml", house_options(wire, "4", more));
    struct house *house = house_load(wire);
    assert_int_equal(wire_wait(wire, client), 0);
    head_end(&head, SIGTERM);
    char *text = wire_read(wire_path(wire, "sweeps"), NULL);
    const int whole = check_sweeps(house, text);
    free(text);
    house_free(house);
    return whole;
}

static void test_sweeps(void **state)
{
    const char *program = build_or_skip(*state);
    for (int run = 1; !run_whole(*state, program); run++)
        if (run == RUNS) fail_msg("no run of %d had whole turns", RUNS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_sweeps, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
