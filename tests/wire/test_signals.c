/* SPDX-License-Identifier: MIT */
/* SIGTERM and SIGINT end the program in good order at any moment: status 0, statistics written, symlink gone, files
 * whole. */
#include <inttypes.h>
#include "tests/wire/room.h"

static const struct room_config ENDLESS = {.profile = "any-rate",
                                           .prr_hz = 100000, /* a busy machine keeps up */
                                           .lines_hz = 100,
                                           .pan_deg_s = 20,
                                           .pan_stop_deg = 360,
                                           .frames = 0,
                                           .links = LINK_YAML_BOTH,
                                           .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

static void expect_symlink(const struct wire *wire, int there)
{
    struct stat st;
    assert_int_equal(lstat(wire_path(wire, "port"), &st) == 0, there);
}

/* The signal comes in the middle of boot, without a client. */
static void test_at_once(void **state)
{
    struct wire *wire = *state;
    static const int signals[] = {SIGTERM, SIGINT};
    room_write(wire);
    for (int i = 0; i < 2; i++) {
        struct head head = head_start(wire, room_config_write(wire, &ENDLESS), NULL);
        expect_symlink(wire, 1);
        head_end(&head, signals[i]);
        expect_symlink(wire, 0);
        assert_int_equal(stats_uint(wire, "scans"), 0);
        remove(wire_path(wire, "stats.json"));
    }
}

/* The signal comes in mid-scan, in real time and in the pace fast. The reader gets everything up to the end of the
 * scan. */
static void in_mid_scan(struct wire *wire, const char *pace, int signal_number)
{
    struct scanhead_frame frame;
    const char *const more[] = {"--pace", pace, NULL};
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    uint64_t pulses = 0;
    int n = 0;
    do {
        client_next(sh, &frame);
        pulses += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
        if (++n == 300) assert_int_equal(kill(head.pid, signal_number), 0);
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    head_end(&head, 0);
    scanhead_close(sh);
    expect_symlink(wire, 0);
    assert_int_equal(stats_uint(wire, "scans"), 1);
    assert_int_equal(stats_uint(wire, "pulses"), pulses);
    assert_int_equal(stats_uint(wire, "fired_pulses"), frame.event_value[1]);
}

static void test_in_mid_scan(void **state)
{
    room_write(*state);
    in_mid_scan(*state, "realtime", SIGTERM);
    in_mid_scan(*state, "fast", SIGINT);
}

/* Signals come as from `timeout`. The second is sent when the first was taken: two that wait would be one. */
static void send_twice(pid_t pid, int signal_number)
{
    char path[64], line[128];
    unsigned long long pending = 1;
    snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
    assert_int_equal(kill(pid, signal_number), 0);
    while (pending != 0) {
        FILE *status = fopen(path, "r");
        assert_non_null(status);
        pending = 0;
        while (fgets(line, sizeof line, status) != NULL)
            if (sscanf(line, "ShdPnd: %llx", &pending) == 1) break;
        fclose(status);
        pending &= 1ull << (signal_number - 1);
    }
    assert_int_equal(kill(pid, signal_number), 0);
}

static void test_with_a_reader_who_does_not_read(void **state)
{
    struct wire *wire = *state;
    struct room_config config = ENDLESS;
    struct scanhead_frame frame;
    config.prr_hz = 1200000;
    config.more = "loop: {pace: fast, queue_ms: 50}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), (const char *const[]){"--start", NULL});
    int idle = raw_connect(head_endpoint(&head, "tcp"));
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    while (scanhead_next(sh, &frame, 1000) == SCANHEAD_OK) { /* until the run is held back */
    }
    send_twice(head.pid, SIGTERM);
    head_end(&head, 0); /* it gives such a reader 2 s, not for ever */
    close(idle);
    scanhead_close(sh);
    assert_int_equal(stats_uint(wire, "scans"), 1);
}

static void test_at_pace_step(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head =
        head_start(wire, room_config_write(wire, &ENDLESS), (const char *const[]){"--pace", "step", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "TIME:STEP 300 MS");
    client_tell(sh, "SCAN:STAR");
    client_tell(sh, "TIME:STEP 100 MS");
    head_end(&head, SIGTERM);
    scanhead_close(sh);
    expect_symlink(wire, 0);
    assert_int_equal(stats_uint(wire, "scans"), 1);
}

/* ---- record */

/* Returns the points of a binary PLY by its own header. The file must have the length that follows from it. */
static uint64_t ply_points(const struct wire *wire, const char *name)
{
    static const struct {
        const char *type;
        size_t size;
    } types[] = {{"double", 8}, {"float64", 8}, {"float", 4}, {"float32", 4}, {"uint", 4},
                 {"uint32", 4}, {"int", 4},     {"int32", 4}, {"ushort", 2},  {"uint16", 2},
                 {"short", 2},  {"int16", 2},   {"uchar", 1}, {"uint8", 1}};
    size_t len, record = 0;
    char *text = wire_read(wire_path(wire, name), &len), *end = strstr(text, "\nend_header\n"), type[32];
    unsigned long long n = 0;
    assert_int_equal(strncmp(text, "ply\nformat binary_little_endian 1.0\n", 36), 0);
    assert_non_null(end);
    for (char *at = text; at < end; at = strchr(at, '\n') + 1) {
        sscanf(at, "element vertex %llu", &n);
        if (sscanf(at, "property %31s", type) != 1) continue;
        for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
            if (strcmp(type, types[i].type) == 0) record += types[i].size;
    }
    assert_true(record >= 12);
    assert_int_equal(len - (size_t)(end + 12 - text), n * record);
    free(text);
    return n;
}

/* Starts `record SOURCE -o FILE` and interrupts it once the file has grown. The file is looked at every 5 ms. */
static void interrupt_record(struct wire *wire, const char *const *args, int signal_number, int expected)
{
    pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    for (int growing = 0; !growing;) {
        DIR *dir = opendir(wire->dir);
        for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
            struct stat st;
            if (strstr(entry->d_name, ".ply") != NULL && stat(wire_path(wire, entry->d_name), &st) == 0)
                growing |= st.st_size > 100000;
        }
        closedir(dir);
        if (wire_now_ms() > end_ms) fail_msg("nothing is being written");
        poll(NULL, 0, 5);
    }
    assert_int_equal(kill(pid, signal_number), 0);
    int status = wire_wait(wire, pid);
    if (status != expected) wire_show(wire, "err");
    assert_int_equal(status, expected);
}

static void expect_error(const struct wire *wire, const char *line)
{
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(err, line) == NULL) fail_msg("no '%s' in: %s", line, err);
    free(err);
}

static uint64_t le64(const char *p)
{
    uint64_t v = 0;
    for (int i = 7; i >= 0; i--)
        v = v << 8 | (uint8_t)p[i];
    return v;
}

/* Returns the points of a LAS file by its header, whose records have 32 bytes. The file must have the length that
 * follows from it. */
static uint64_t las_points(const struct wire *wire, const char *name)
{
    size_t len;
    char *las = wire_read(wire_path(wire, name), &len);
    uint64_t n = le64(las + 247), first = le64(las + 96) & UINT32_MAX;
    assert_int_equal(strncmp(las, "LASF", 4), 0);
    assert_int_equal(first + 32 * n, len);
    free(las);
    return n;
}

/* An E57 file is finished when its header has its length. */
static void expect_whole_e57(const struct wire *wire, const char *name)
{
    size_t len;
    char *e57 = wire_read(wire_path(wire, name), &len);
    assert_int_equal(strncmp(e57, "ASTM-E57", 8), 0);
    assert_int_equal(le64(e57 + 16), len);
    free(e57);
}

/* A PTX grid has columns times rows lines after its head of ten. */
static void expect_whole_ptx(const struct wire *wire, const char *name)
{
    char *ptx = wire_read(wire_path(wire, name), NULL);
    uint64_t columns, rows, lines = 0;
    assert_int_equal(sscanf(ptx, "%" SCNu64 " %" SCNu64, &columns, &rows), 2);
    for (const char *at = ptx; (at = strchr(at, '\n')) != NULL; at++)
        lines++;
    assert_int_equal(lines, 10 + columns * rows);
    free(ptx);
}

static void test_record_off_line(void **state)
{
    struct wire *wire = *state;
    char config[352], ply[352], las[352], e57[352], ptx[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &ENDLESS));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    snprintf(las, sizeof las, "%s", wire_path(wire, "x.las"));
    snprintf(e57, sizeof e57, "%s", wire_path(wire, "x.e57"));
    snprintf(ptx, sizeof ptx, "%s", wire_path(wire, "x.ptx"));
    interrupt_record(wire,
                     (const char *const[]){"record", config, "-o", ply, "-o", las, "-o", e57, "-o", ptx, "--duration",
                                           "1e6", "--stats", wire_path(wire, "stats.json"), NULL},
                     SIGINT, 1);
    expect_error(wire, "interrupted; missing: the end of the scan\n");
    assert_int_equal(ply_points(wire, "x.ply"), stats_uint(wire, "points"));
    assert_int_equal(las_points(wire, "x.las"), stats_uint(wire, "points"));
    expect_whole_e57(wire, "x.e57");
    expect_whole_ptx(wire, "x.ptx");
    assert_true(stats_uint(wire, "points") > 1000);
}

static void test_record_from_a_head(void **state)
{
    struct wire *wire = *state;
    char source[352], ply[352], stats[352];
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), NULL);
    snprintf(source, sizeof source, "%s", head_endpoint(&head, "pty"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "record.json"));
    interrupt_record(wire, (const char *const[]){"record", source, "-o", ply, "--stats", stats, NULL}, SIGTERM,
                     0); /* a scan without end is complete when it is stopped */
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle"); /* it has stopped the scan it began */
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(ply_points(wire, "x.ply") > 1000);
    assert_int_equal(ply_points(wire, "x.ply"), stats_uint(wire, "echoes")); /* to the last one */
}

/* Writes a profile like full-sweep, with another value of one key, in seconds. */
static void profile_write(const struct wire *wire, const char *key, const char *value)
{
    char *text = wire_read("config/heads/full-sweep.yaml", NULL), line[32];
    snprintf(line, sizeof line, "\n%s: { value: ", key);
    char *at = strstr(text, line), path[352];
    assert_non_null(at);
    at += strlen(line);
    char *rest = at + strcspn(at, ",");
    snprintf(path, sizeof path, "%s", wire_path(wire, "slow.yaml"));
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "%.*s%s%s", (int)(at - text), text, value, rest);
    assert_int_equal(fclose(f), 0);
    free(text);
}

/* A head takes long for the named step, and a recorder waits for it. The recorder is interrupted as soon as `state` is
 * seen. */
static void stop_early(struct wire *wire, const char *key, const char *state, int signal_number, const char *says)
{
    struct room_config config = ENDLESS;
    char source[352], ply[352];
    config.profile = "slow.yaml";
    room_write(wire);
    profile_write(wire, key, "100");
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    snprintf(source, sizeof source, "%s", head_endpoint(&head, "tcp"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    struct scanhead *sh = client_open(source);
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    pid_t pid = wire_spawn(wire, (const char *const[]){"record", source, "-o", ply, NULL}, "out", "err", -1);
    while (access(wire_path(wire, "x.ply.part"), F_OK) != 0 || strcmp(client_ask(sh, "HEAD:STAT?"), state) != 0)
        if (wire_now_ms() > end_ms) fail_msg("the head does not come to %s", state);
    assert_int_equal(kill(pid, signal_number), 0);
    assert_int_equal(wire_wait(wire, pid), 1);
    expect_error(wire, says);
    assert_int_not_equal(access(ply, F_OK), 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_record_before_the_scan(void **state)
{
    stop_early(*state, "boot_s", "boot", SIGINT, "interrupted; missing: the scan\n");
    stop_early(*state, "spin_up_s", "spin-up", SIGTERM, "interrupted; missing: the scan\n");
}

/* The output names the stations that an interruption left out. The scan at hand goes on for hours. */
static void test_record_of_stations(void **state)
{
    static const struct {
        const char *station, *more[3], *says;
    } rows[] = {
        {"all",
         {"--set", "stations.2.position_m=[1, 0, 0]"},
         "interrupted; missing: the end of the scan from station 1 and the scans from stations 2 to 3\n"},
        {"all", {NULL}, "interrupted; missing: the end of the scan from station 1 and the scan from station 2\n"},
        {"2", {NULL}, "interrupted; missing: the end of the scan from station 2\n"},
    };
    struct wire *wire = *state;
    struct room_config config = ENDLESS;
    char path[352], ply[352];
    config.frames = 100000;
    room_write(wire);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        interrupt_record(wire,
                         (const char *const[]){"record", path, "--station", rows[i].station, "-o", ply, "--set",
                                               "stations.1.position_m=[0, 0, 0]", rows[i].more[0], rows[i].more[1],
                                               NULL},
                         SIGINT, 1);
        expect_error(wire, rows[i].says);
        assert_true(ply_points(wire, "x.ply") > 1000);
        assert_int_equal(unlink(ply), 0); /* the next recording is known by its growth */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_at_once, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_in_mid_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_with_a_reader_who_does_not_read, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_at_pace_step, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_record_off_line, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_record_from_a_head, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_record_before_the_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_record_of_stations, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
