/* SPDX-License-Identifier: MIT */
/* The GNSS receiver is read by gpsd, the most common client, and gpspipe. */
#include "tests/wire/gnss_rig.h"
#include "tests/wire/unit_faults.h"

static int in_path(const char *program)
{
    char path[1024];
    const char *dirs[] = {"/usr/sbin", "/usr/local/sbin", "/usr/bin", "/usr/local/bin"};
    for (size_t i = 0; i < sizeof dirs / sizeof *dirs; i++) {
        snprintf(path, sizeof path, "%s/%s", dirs[i], program);
        if (access(path, X_OK) == 0) return 1;
    }
    return 0;
}

/* Starts a program of the system with its standard output on out_fd (-1: nowhere). */
static pid_t spawn(struct wire *wire, const char *const *args, int out_fd)
{
    char env_path[] = "PATH=/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/sbin:/usr/local/bin", *env[] = {env_path, NULL};
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    int null = open("/dev/null", O_RDWR);
    dup2(null, 0);
    dup2(out_fd >= 0 ? out_fd : null, 1);
    dup2(null, 2);
    signal(SIGPIPE, SIG_DFL);
    putenv(env[0]);
    execvp(args[0], (char *const *)(uintptr_t)args);
    _exit(127);
}

/* Waits until the program (pid) listens there. The program does not announce that, so its port is asked again and
 * again. */
static void wait_listening(pid_t pid, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    int pidfd = pidfd_open(pid, 0);
    for (;;) {
        int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        int rc = connect(fd, (struct sockaddr *)&at, sizeof at);
        close(fd);
        if (rc == 0) break;
        struct pollfd slot = {.fd = pidfd, .events = POLLIN};
        if (poll(&slot, 1, 20) != 0) fail_msg("gpsd ended before it listened");
        if (wire_now_ms() > end_ms) fail_msg("gpsd does not listen on port %d", port);
    }
    close(pidfd);
}

static void end_child(struct wire *wire, pid_t pid)
{
    kill(pid, SIGTERM);
    wire_wait(wire, pid);
}

/* Returns the number after "key": in a line of JSON; 0: there is none. */
static int json_number(const char *json, const char *key, double *value)
{
    char name[64], *end;
    snprintf(name, sizeof name, "\"%s\":", key);
    const char *at = strstr(json, name);
    if (at == NULL) return 0;
    *value = strtod(at + strlen(name), &end);
    return end != at + strlen(name);
}

struct gpsd {
    struct wire *wire;
    pid_t daemon, pipe;
    int fd;
    char buf[16384];
    size_t len;
};

static void gpsd_start(struct gpsd *g, struct wire *wire)
{
    char port[16], server[32], device[352];
    int number, out[2];
    close(wire_bind(SOCK_STREAM, &number)); /* a port that is free now */
    snprintf(port, sizeof port, "%d", number);
    snprintf(server, sizeof server, "127.0.0.1:%d", number);
    snprintf(device, sizeof device, "%s", wire_path(wire, "gnss"));
    const char *const daemon[] = {"gpsd", "-N", "-n", "-S", port, device, NULL};
    const char *const pipe_args[] = {"gpspipe", "-w", server, NULL};
    memset(g, 0, sizeof *g);
    g->wire = wire;
    g->daemon = spawn(wire, daemon, -1);
    wait_listening(g->daemon, number);
    assert_int_equal(pipe2(out, O_CLOEXEC), 0);
    g->pipe = spawn(wire, pipe_args, out[1]);
    close(out[1]);
    g->fd = out[0];
}

/* Returns the next line of gpspipe, which is good until the next call. */
static const char *gpsd_line(struct gpsd *g)
{
    static char line[4096];
    char *end;
    while ((end = memchr(g->buf, '\n', g->len)) == NULL) {
        struct pollfd slot = {.fd = g->fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("gpspipe says nothing");
        assert_true(g->len < sizeof g->buf);
        ssize_t n = read(g->fd, g->buf + g->len, sizeof g->buf - g->len);
        if (n <= 0) fail_msg("gpspipe ended");
        g->len += (size_t)n;
    }
    size_t n = (size_t)(end - g->buf) + 1;
    snprintf(line, sizeof line, "%.*s", (int)n - 1, g->buf);
    memmove(g->buf, g->buf + n, g->len - n);
    g->len -= n;
    return line;
}

/* Returns the next TPV with a position in three dimensions. */
static const char *gpsd_fix(struct gpsd *g)
{
    double mode;
    for (;;) {
        const char *line = gpsd_line(g);
        if (strstr(line, "\"class\":\"TPV\"") == NULL) continue;
        if (json_number(line, "mode", &mode) && mode == 3) return line;
    }
}

static void gpsd_stop(struct gpsd *g)
{
    close(g->fd);
    kill(g->pipe, SIGKILL);
    wire_wait(g->wire, g->pipe);
    end_child(g->wire, g->daemon);
}

/* Returns "time":"2026-01-01T00:00:07.200Z" as tenths of a second since midnight. */
static int tpv_tenths(const char *line)
{
    const char *at = strstr(line, "\"time\":\"2026-01-01T");
    int h = 0, m = 0, s = 0, ms = 0;
    if (at == NULL || sscanf(at + 19, "%d:%d:%d.%3dZ", &h, &m, &s, &ms) != 4) fail_msg("no time in %s", line);
    assert_int_equal(ms % 100, 0);
    return ((h * 60 + m) * 60 + s) * 10 + ms / 100;
}

static double number(const char *line, const char *key)
{
    double value = 0;
    if (!json_number(line, key, &value)) fail_msg("no %s in %s", key, line);
    return value;
}

/* The bound is half a step of the sentence, 0.5e-7', and half of gpsd's nine decimals: 0.15 mm on the ground. A height
 * of three decimals goes in, and one of four comes out; the separation is 0. Together that is 0.61 mm, and the promise
 * is 1 mm. */
static const double ANGLE_TOLERANCE_DEG = 0.5e-7 / 60 + 0.5e-9 + 1e-12, HEIGHT_TOLERANCE_M = 0.5e-3 + 0.5e-4 + 1e-9;

/* Status as gpsd_json(5) of 3.2x defines it: 1 a fix (left out), 2 DGPS, 3 RTK fixed, 4 RTK float. */
static void check_gpsd(struct wire *wire, int quality, int status)
{
    char set[64];
    snprintf(set, sizeof set, "gnss.quality=%d", quality);
    const char *const more[] = {PLACE, "--set", "gnss.geoid_separation_m=22.4321", "--set", "gnss.rate_hz=5", "--set",
                                set,   NULL};
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct gpsd gpsd;
    gpsd_start(&gpsd, wire);
    int before = -1;
    for (int n = 0; n < 3;) {
        const char *line = gpsd_fix(&gpsd);
        int tenths = tpv_tenths(line);
        double said = 1;
        json_number(line, "status", &said);
        if (said != status) fail_msg("status %g instead of %d: %s", said, status, line);
        assert_true(fabs(number(line, "lat") - LAT_DEG) <= ANGLE_TOLERANCE_DEG);
        assert_true(fabs(number(line, "lon") - LON_DEG) <= ANGLE_TOLERANCE_DEG);
        assert_true(fabs(number(line, "altHAE") - HEIGHT_M) <= HEIGHT_TOLERANCE_M);
        assert_true(fabs(number(line, "geoidSep") - 22.4321) <= 0.5e-3); /* gpsd gives three decimals */
        assert_true(number(line, "speed") == 0);
        /* gpsd may report the same moment twice, as sentences come. A busy machine may let it read so late that a whole
         * fix is lost on the way; a fix is every 0.2 s. */
        if (before >= 0 && tenths != before) assert_true(tenths > before && (tenths - before) % 2 == 0);
        n += tenths != before;
        before = tenths;
        /* The fix's time is in the past: the head's own clock, asked now, is not before it. */
        int h, m;
        double s;
        assert_int_equal(sscanf(client_ask(sh, "TIME:UTC?"), "2026-01-01T%d:%d:%lfZ", &h, &m, &s), 3);
        assert_true(((h * 60 + m) * 60 + s) * 10 >= tenths);
    }
    gpsd_stop(&gpsd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    wire_empty(wire);
}

static void test_gpsd(void **state)
{
    if (!in_path("gpsd") || !in_path("gpspipe")) {
        print_message("# no gpsd, gpspipe (packages gpsd, gpsd-clients)\n");
        skip();
    }
    check_gpsd(*state, 4, 3);
    check_gpsd(*state, 5, 4);
    check_gpsd(*state, 2, 2);
    check_gpsd(*state, 1, 1);
}

/* ---- sentences that go wrong on request: for 2 s as a bad cable makes them, then for 1 s with wrong positions whose
 * checksums are right. There are 20 fixes a second. */

enum { HURT_UNITS = 40, SEALED_UNITS = 20 };
static const char HURT[] = "faults:\n"
                           "  - {kind: drop, link: 2, until: 40, probability: 0.2, seed: 1}\n"
                           "  - {kind: flip, link: 2, until: 40, probability: 0.4, seed: 2}\n"
                           "  - {kind: flip, n: 20, link: 2, until: 40, probability: 0.1, seed: 3}\n"
                           "  - {kind: truncate, link: 2, until: 40, probability: 0.2, seed: 4}\n"
                           "  - {kind: garbage, n: 24, link: 2, until: 40, probability: 0.3, seed: 5}\n"
                           "  - {kind: reorder, link: 2, until: 40, probability: 0.2, seed: 6}\n"
                           "  - {kind: flip, n: 300, reseal: on, link: 2, from: 41, until: 60}\n";

static int is_right(const char *line)
{
    double height_m = HEIGHT_M; /* a TPV of RMC alone has none */
    json_number(line, "altHAE", &height_m);
    return fabs(number(line, "lat") - LAT_DEG) <= ANGLE_TOLERANCE_DEG &&
           fabs(number(line, "lon") - LON_DEG) <= ANGLE_TOLERANCE_DEG &&
           fabs(height_m - HEIGHT_M) <= HEIGHT_TOLERANCE_M;
}

/* The text has become longer. */
static int has_grown(const char *text, const void *len)
{
    return strlen(text) > *(const size_t *)len && text[strlen(text) - 1] == '\n';
}

/* Returns the number of the last note of the faulty link. */
static uint32_t last_note(const struct wire *wire, struct truth_note **note, uint32_t *n_notes)
{
    free(*note);
    *note = truth_read(wire_path(wire, "truth.json"), 2, n_notes);
    return *n_notes != 0 ? (uint32_t)(*note)[*n_notes - 1].number : 0;
}

/* The truth is written by a thread of its own, so gpsd may have a sentence before its note. The sentence's note is then
 * the next one. */
static uint32_t next_note(const struct wire *wire, struct truth_note **note, uint32_t *n_notes)
{
    size_t len;
    free(wire_read(wire_path(wire, "truth.json"), &len));
    const uint32_t last = last_note(wire, note, n_notes);
    if (last > HURT_UNITS) return last;
    free(wire_read_with(wire_path(wire, "truth.json"), has_grown, &len));
    return last_note(wire, note, n_notes);
}

/* Reads gpsd's output until all faults have struck and a second of right positions has followed. Returns the wrong
 * ones. */
static uint32_t read_through(struct wire *wire, struct gpsd *gpsd, struct truth_note **note, uint32_t *n_notes)
{
    uint32_t n_wrong = 0;
    *note = NULL;
    for (int n_right = 0; n_right < 20;) {
        const char *line = gpsd_fix(gpsd);
        const int right = is_right(line);
        const uint32_t last = right ? last_note(wire, note, n_notes) : next_note(wire, note, n_notes);
        if (!right && last <= HURT_UNITS) fail_msg("after unit %u: %s", last, line);
        n_wrong += !right;
        n_right = right && last == HURT_UNITS + SEALED_UNITS ? n_right + 1 : 0;
    }
    return n_wrong;
}

/* A sentence with a wrong checksum gives no position. A sentence whose checksum was made right is taken. gpsd reports
 * at most once a sentence, and a fix has five. A wrong fix lasts until the sentences of the next one. */
static void test_gpsd_hurt(void **state)
{
    struct wire *wire = *state;
    if (!in_path("gpsd") || !in_path("gpspipe")) {
        print_message("# no gpsd, gpspipe (packages gpsd, gpsd-clients)\n");
        skip();
    }
    char scenario[352], truth[352];
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "hurt.yaml", HURT));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    const char *const more[] = {PLACE, "--set", "gnss.rate_hz=20", "--scenario", scenario, "--truth", truth, NULL};
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct gpsd gpsd;
    gpsd_start(&gpsd, wire);
    struct truth_note *note;
    uint32_t n;
    const uint32_t n_wrong = read_through(wire, &gpsd, &note, &n);
    static const char *const kinds[] = {"drop", "truncate", "garbage", "reorder"};
    uint32_t n_sealed = 0;
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        assert_true(truth_count(note, n, kinds[i]) > 0);
    for (uint32_t i = 0; i < n; i++)
        n_sealed += strcmp(note[i].text, "resealed") == 0;
    assert_int_equal(n_sealed, SEALED_UNITS);
    assert_true(truth_count(note, n, "flip") > n_sealed);
    assert_in_range(n_wrong, 1, 5 * (n_sealed + 1));
    free(note);
    gpsd_stop(&gpsd);
    head_end(&head, SIGTERM);
}

/* ---- a head that moves along a straight line at constant speed, so that half-way poses are a closed form */

static const double VELOCITY_M_S[3] = {1.1, 0.7, 0.15}, DRIVE_S = 60.0;

static void write_drive(const struct wire *wire)
{
    FILE *f = fopen(wire_path(wire, "drive.csv"), "w");
    assert_non_null(f);
    fprintf(f, "t_s,x_m,y_m,z_m,heading_deg\n");
    for (double t = 0.0; t <= DRIVE_S; t += 0.5)
        fprintf(f, "%.17g,%.17g,%.17g,%.17g,30\n", t, STATION[0] + VELOCITY_M_S[0] * t,
                STATION[1] + VELOCITY_M_S[1] * t, STATION[2] + VELOCITY_M_S[2] * t);
    assert_int_equal(fclose(f), 0);
}

/* The ellipsoid is WGS 84, NIMA TR8350.2. */
static void to_ecef(double lat_deg, double lon_deg, double height_m, double p[3])
{
    const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f), deg = M_PI / 180;
    double s = sin(lat_deg * deg), c = cos(lat_deg * deg), n = a / sqrt(1 - e2 * s * s);
    p[0] = (n + height_m) * c * cos(lon_deg * deg);
    p[1] = (n + height_m) * c * sin(lon_deg * deg);
    p[2] = (n * (1 - e2) + height_m) * s;
}

/* Gives east, north and up from the station. */
static void from_station(const char *line, double d[3])
{
    double p[3], q[3], lat = LAT_DEG * M_PI / 180, lon = LON_DEG * M_PI / 180;
    to_ecef(LAT_DEG, LON_DEG, HEIGHT_M, p);
    to_ecef(number(line, "lat"), number(line, "lon"), number(line, "altHAE"), q);
    double x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
    d[0] = -sin(lon) * x + cos(lon) * y;
    d[1] = -sin(lat) * cos(lon) * x - sin(lat) * sin(lon) * y + cos(lat) * z;
    d[2] = cos(lat) * cos(lon) * x + cos(lat) * sin(lon) * y + sin(lat) * z;
}

/* Compares with the trajectory that long after the scan's start, to the sentences' rounding, as above. Speed and course
 * are good to 0.0005 knots and 0.01 degrees, and gpsd's three and four decimals. */
static void check_drive(const char *line, double since_s)
{
    double d[3], t = since_s < 0.0 ? 0.0 : since_s;
    from_station(line, d);
    for (int i = 0; i < 3; i++)
        if (fabs(d[i] - VELOCITY_M_S[i] * t) > 0.0005)
            fail_msg("%g s after the start %g %g %g m from the station", since_s, d[0], d[1], d[2]);
    if (since_s < 0.01) return; /* it stands, or starts */
    double course_deg = atan2(VELOCITY_M_S[0], VELOCITY_M_S[1]) * 180 / M_PI;
    assert_true(fabs(number(line, "speed") - hypot(VELOCITY_M_S[0], VELOCITY_M_S[1])) < 0.0005 * 0.5145 + 0.0005);
    double off_deg = number(line, "track") - course_deg; /* the sentence rounds down */
    assert_true(off_deg > -0.01 - 0.0001 && off_deg < 0.0001);
}

static void test_gpsd_moves(void **state)
{
    struct wire *wire = *state;
    if (!in_path("gpsd") || !in_path("gpspipe")) {
        print_message("# no gpsd, gpspipe (packages gpsd, gpsd-clients)\n");
        skip();
    }
    char file[400];
    snprintf(file, sizeof file, "platform.file=%s", wire_path(wire, "drive.csv"));
    const char *const more[] = {
        PLACE, "--set", "gnss.quality=4", "--set", "gnss.rate_hz=10", "--set", "platform.kind=trajectory", "--set",
        file,  NULL};
    write_drive(wire);
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct gpsd gpsd;
    gpsd_start(&gpsd, wire);
    check_drive(gpsd_fix(&gpsd), -1.0); /* no scan yet */
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_START, &frame);
    double start_s = 1e-9 * (double)frame.event_value[1], since_s;
    int before = -1, n = 0;
    scanhead_close(sh);
    do {
        const char *line = gpsd_fix(&gpsd);
        int tenths = tpv_tenths(line);
        since_s = 0.1 * tenths - start_s;
        /* before the receiver knew the start, the head stood */
        check_drive(line, since_s);
        n += tenths != before;
        before = tenths;
    } while (since_s < 3.0);
    assert_true(n >= 30);
    gpsd_stop(&gpsd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_gpsd, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_gpsd_hurt, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_gpsd_moves, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
