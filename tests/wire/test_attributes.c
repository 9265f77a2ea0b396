/* SPDX-License-Identifier: MIT */
/* output.attributes from the configuration to the files: what stays the same, what is added, and the result of a reader
 * that has lost a part. */
#include "drivers/protocol/native.h"
#include "tests/wire/room.h"

static const struct room_config SCAN = {
    .profile = "riegl-vz400i",
    .prr_hz = 100000,
    .lines_hz = 50,
    .pan_deg_s = 150,
    .pan_stop_deg = 60,
    .frames = 1,
    .links = "links: [{type: \"null\"}, {type: tcp, port: 0}]\n",
    .more = "beam: {mode: adaptive}\nsignal: {model: on}\nloop: {queue_ms: 10000, late_ms: 10000}\n"};

enum { MOST = 200000 };
struct told {
    double range_m, amplitude_db, width_ns;
};
static struct told told[MOST]; /* echoes of the stream, in order */
static size_t n_told;

static const char *begin(struct wire *wire)
{
    static char config[352];
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a"); /* a board 0.3 m before the wall, whose edges cut footprints */
    assert_non_null(f);
    fputs("v 3 3.6 -1.5\nv 3.5 3.65 -1.5\nv 3.5 3.65 2.5\nv 3 3.6 2.5\no board\nusemtl paint-board\nf 9 10 11 12\n", f);
    assert_int_equal(fclose(f), 0);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    return config;
}

/* Returns the exit status. The statistics are in stats.json. */
static int record(struct wire *wire, const char *source, const char *set, const char *const *files)
{
    char stats[352], path[4][352];
    const char *args[24] = {"record", source, "--stats", stats, "--quiet"};
    int n = 5;
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    if (set != NULL) {
        args[n++] = "--set";
        args[n++] = set;
    }
    for (int i = 0; files[i] != NULL; i++) {
        snprintf(path[i], sizeof path[i], "%s", wire_path(wire, files[i]));
        args[n++] = "-o";
        args[n++] = path[i];
        if (strcmp(files[i] + strlen(files[i]) - 4, ".ply") == 0) args[n++] = "--ascii";
    }
    args[n] = NULL;
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

static struct scanhead *open_stream(const struct wire *wire, const char *name)
{
    return client_open(wire_path(wire, name));
}

/* Takes the next frame that the hash includes. Returns 0 at the end. */
static int next_hashed(struct scanhead *sh, struct scanhead_frame *frame, int without_attributes)
{
    do {
        if (scanhead_next(sh, frame, 0) != SCANHEAD_OK) return 0;
    } while ((frame->flags & 3) != 0 || frame->type == SCANHEAD_TELEMETRY || frame->type == SCANHEAD_EVENT ||
             frame->type == SCANHEAD_SURFACES || (without_attributes && frame->type == SCANHEAD_ATTRIBUTES));
    return 1;
}

/* Off, the stream has nothing new: no frame, and not a byte of the descriptor. On, all else is the same. */
static void test_off_and_on(void **state)
{
    struct wire *wire = *state;
    const char *config = begin(wire);
    char off_hash[65], on_hash[65], hash[65];
    assert_int_equal(record(wire, config, "output.attributes=off", (const char *const[]){"off.shs", NULL}), 0);
    stats_hash(wire, off_hash);
    assert_int_equal(record(wire, config, NULL, (const char *const[]){"default.shs", NULL}), 0);
    stats_hash(wire, hash);
    assert_string_equal(hash, off_hash);
    assert_int_equal(record(wire, config, "output.attributes=on", (const char *const[]){"on.shs", NULL}), 0);
    stats_hash(wire, on_hash);
    assert_string_not_equal(on_hash, off_hash);
    struct scanhead *off = open_stream(wire, "off.shs"), *on = open_stream(wire, "on.shs");
    struct scanhead_frame a, b;
    uint32_t points = 0;
    int64_t later_ns = 0; /* all times of the second scan differ by this */
    for (int n = 0; next_hashed(off, &a, 0); n++) {
        assert_true(next_hashed(on, &b, 1));
        assert_true(a.type != SCANHEAD_ATTRIBUTES);
        assert_int_equal(a.type, b.type);
        if (n == 0) later_ns = b.t_ns - a.t_ns;
        assert_int_equal(a.t_ns + later_ns, b.t_ns);
        if (a.type == SCANHEAD_DESCRIPTOR) {
            assert_int_equal(a.payload_len, 272);
            assert_int_equal(b.payload_len, 280);
        } else {
            assert_int_equal(a.payload_len, b.payload_len);
        }
        assert_memory_equal(a.payload, b.payload, a.payload_len);
        points += a.type == SCANHEAD_POINTS;
    }
    assert_false(next_hashed(on, &b, 1));
    assert_true(points > 100);
    assert_int_equal(scanhead_has_attributes(off), 0);
    assert_int_equal(scanhead_has_attributes(on), 1);
    scanhead_close(off);
    scanhead_close(on);
}

/* Each frame of points is followed by its attributes, which are kept by echo. */
static void keep_told(const struct wire *wire, const char *name)
{
    static struct scanhead_point point[NATIVE_MAX_POINTS];
    static struct scanhead_attribute attribute[NATIVE_MAX_POINTS];
    struct scanhead *sh = open_stream(wire, name);
    struct scanhead_frame frame;
    uint32_t seq = 0, n = 0;
    n_told = 0;
    assert_int_equal(scanhead_has_attributes(sh), SCANHEAD_ESTATE);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        assert_int_equal(n != 0, frame.type == SCANHEAD_ATTRIBUTES);
        if (frame.type == SCANHEAD_POINTS) {
            n = frame.n_points;
            seq = frame.seq;
            assert_int_equal(scanhead_points(sh, &frame, 0, point, NATIVE_MAX_POINTS), n);
        }
        if (frame.type != SCANHEAD_ATTRIBUTES) continue;
        assert_int_equal(frame.seq, seq + 1);
        assert_int_equal(frame.n_points, n);
        assert_int_equal(scanhead_attributes(sh, &frame, 0, attribute, NATIVE_MAX_POINTS), n);
        assert_int_equal(scanhead_attributes(sh, &frame, n - 1, attribute + n - 1, 7), 1);
        assert_int_equal(scanhead_attributes(sh, &frame, n, attribute, 7), 0);
        for (uint32_t i = 0; i < n; i++) {
            if (point[i].echo_count == 0) {
                assert_true(isnan(attribute[i].amplitude_db) && isnan(attribute[i].width_ns));
                continue;
            }
            assert_true(attribute[i].amplitude_db >= 0.0 && attribute[i].amplitude_db < 100.0);
            assert_true(attribute[i].width_ns > 0.0);
            assert_true(n_told < MOST);
            told[n_told++] = (struct told){point[i].range_m, attribute[i].amplitude_db, attribute[i].width_ns};
        }
        n = 0;
    }
    scanhead_close(sh);
}

/* Compares amplitude and width of each vertex of a PLY as text with the stream's. From `lost` to `end` they are lost
 * (0, 0: none). */
static void check_ply(const struct wire *wire, const char *name, size_t lost, size_t end)
{
    char *text = wire_read(wire_path(wire, name), NULL);
    const char *at = strstr(text, "property float amplitude\nproperty float width\nend_header\n");
    size_t n = 0;
    assert_non_null(at);
    for (at = strstr(at, "end_header\n") + 11; *at != 0; at = strchr(at, '\n') + 1, n++) {
        double range_m;
        char amplitude[32], width[32];
        assert_int_equal(sscanf(at, "%*s %*s %*s %lf %*s %*s %*s %*s %*s %*s %31s %31s", &range_m, amplitude, width),
                         3);
        assert_true(n < n_told);
        assert_true(fabs(range_m - told[n].range_m) < 1e-6);
        if (n >= lost && n < end) {
            assert_string_equal(amplitude, "nan");
            assert_string_equal(width, "nan");
            continue;
        }
        assert_true(fabs(atof(amplitude) - told[n].amplitude_db) < 0.001);
        assert_true(fabs(atof(width) - told[n].width_ns) < 0.001);
    }
    assert_int_equal(n, n_told);
    free(text);
}

static int64_t number(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[i];
    return (int64_t)v;
}

static double real(const uint8_t *p)
{
    int64_t v = number(p, 8);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

/* Checks by the LAS 1.4 specification: extra bytes described in a record of LASF_Spec, 4, with types 4 (int16) and 3
 * (uint16), their scales, and the value that stands for none. */
static void check_las(const struct wire *wire, const char *name)
{
    size_t len;
    const uint8_t *las = (const uint8_t *)wire_read(wire_path(wire, name), &len), *vlr = las + number(las + 94, 2);
    const int64_t points_at = number(las + 96, 4), record = number(las + 105, 2);
    assert_memory_equal(las, "LASF", 4);
    assert_int_equal(record, 30 + 2 + 2 + 2);
    while (strcmp((const char *)vlr + 2, "LASF_Spec") != 0 || number(vlr + 18, 2) != 4)
        vlr += 54 + number(vlr + 20, 2);
    assert_int_equal(number(vlr + 20, 2), 3 * 192);
    const uint8_t *amplitude = vlr + 54 + 192, *width = amplitude + 192;
    assert_string_equal((const char *)vlr + 54 + 4, "label");
    assert_string_equal((const char *)amplitude + 4, "amplitude");
    assert_int_equal(amplitude[2], 4);
    assert_int_equal(amplitude[3], 1 | 8); /* no_data and scale count */
    assert_int_equal(number(amplitude + 40, 8), -32768);
    assert_true(real(amplitude + 112) == 0.01);
    assert_string_equal((const char *)width + 4, "width");
    assert_int_equal(width[2], 3);
    assert_int_equal(width[3], 1 | 8);
    assert_int_equal(number(width + 40, 8), 0);
    assert_true(real(width + 112) == 0.01);
    assert_int_equal(number(las + 247, 8), n_told);
    assert_int_equal(len, (size_t)points_at + n_told * (size_t)record);
    for (size_t i = 0; i < n_told; i++) {
        const uint8_t *p = las + points_at + (int64_t)i * record;
        assert_true(fabs(0.01 * (int16_t)number(p + 32, 2) - told[i].amplitude_db) < 0.001);
        assert_true(fabs(0.01 * (double)number(p + 34, 2) - told[i].width_ns) < 0.001);
    }
    free((void *)(uintptr_t)las);
}

static void test_files(void **state)
{
    struct wire *wire = *state;
    const char *config = begin(wire);
    char stream[352];
    char hash[65], again[65];
    double least = INFINITY, most = 0.0;
    assert_int_equal(record(wire, config, "output.attributes=on",
                            (const char *const[]){"a.ply", "a.las", "a.shs", "a.pcapng", NULL}),
                     0);
    stats_hash(wire, hash);
    keep_told(wire, "a.shs");
    assert_true(n_told > 5000);
    for (size_t i = 0; i < n_told; i++) {
        least = fmin(least, told[i].width_ns);
        most = fmax(most, told[i].width_ns);
    }
    assert_true(least == 4.0 && most > 4.2); /* the profile's pulse; board and wall in one echo */
    check_ply(wire, "a.ply", 0, 0);
    check_las(wire, "a.las");
    /* The recording of the stream has the same. */
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "a.shs"));
    assert_int_equal(record(wire, stream, NULL, (const char *const[]){"b.ply", "b.las", "b.shs", NULL}), 0);
    stats_hash(wire, again);
    assert_string_equal(again, hash);
    check_ply(wire, "b.ply", 0, 0);
    check_las(wire, "b.las");
}

/* A head runs in real time, over TCP. The hash of the head, the client and the recording off line are the same. */
static void test_live(void **state)
{
    struct wire *wire = *state;
    const char *config = begin(wire);
    char off_line[65], client[65], live[65];
    struct scanhead_frame frame;
    uint64_t follows = 0;
    assert_int_equal(record(wire, config, "output.attributes=on", (const char *const[]){NULL}), 0);
    stats_hash(wire, off_line);
    struct head head = head_start(wire, config, (const char *const[]){"--set", "output.attributes=on", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        follows += frame.type == SCANHEAD_ATTRIBUTES;
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    scanhead_hash_hex(sh, client);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, live);
    assert_true(follows > 100);
    assert_string_equal(client, off_line);
    assert_string_equal(live, off_line);
}

/* Copies a stream without its frame number `which` of a type. */
static void leave_out(const struct wire *wire, const char *from, const char *to, int type, uint32_t which)
{
    struct scanhead *sh = open_stream(wire, from);
    struct scanhead_frame frame;
    FILE *out = fopen(wire_path(wire, to), "wb");
    uint32_t n = 0;
    assert_non_null(out);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == type && n++ == which) continue;
        assert_int_equal(fwrite(frame.raw, 1, frame.raw_len, out), frame.raw_len);
    }
    assert_true(n > which);
    assert_int_equal(fclose(out), 0);
    scanhead_close(sh);
}

/* Counts the echoes before the points frame `which`, and in it. */
static void count_echoes(const struct wire *wire, const char *name, uint32_t which, size_t *before, size_t *within)
{
    static struct scanhead_point point[NATIVE_MAX_POINTS];
    struct scanhead *sh = open_stream(wire, name);
    struct scanhead_frame frame;
    *before = *within = 0;
    for (uint32_t n = 0; n <= which && scanhead_next(sh, &frame, 0) == SCANHEAD_OK;) {
        if (frame.type != SCANHEAD_POINTS) continue;
        *before += *within;
        *within = 0;
        int got = scanhead_points(sh, &frame, 0, point, NATIVE_MAX_POINTS);
        for (int i = 0; i < got; i++)
            *within += point[i].echo_count != 0;
        n++;
    }
    scanhead_close(sh);
}

/* If attributes are lost the points stay, without any. If points are lost, their attributes are not given to
 * others. The recording says that it is not complete. */
static void test_lost(void **state)
{
    struct wire *wire = *state;
    const char *config = begin(wire);
    char stream[352], says[128];
    size_t before, within;
    assert_int_equal(record(wire, config, "output.attributes=on", (const char *const[]){"a.shs", NULL}), 0);
    static const uint32_t which[] = {0, 40, 60};
    for (int i = 0; i < 3; i++) {
        keep_told(wire, "a.shs");
        count_echoes(wire, "a.shs", which[i], &before, &within);
        assert_true(within > 10);
        leave_out(wire, "a.shs", "b.shs", SCANHEAD_ATTRIBUTES, which[i]);
        snprintf(stream, sizeof stream, "%s", wire_path(wire, "b.shs"));
        assert_int_equal(record(wire, stream, NULL, (const char *const[]){"b.ply", "b.las", NULL}), 1);
        assert_int_equal(stats_uint(wire, "seq_lost"), 1);
        check_ply(wire, "b.ply", before, before + within);
        char *text = wire_read(wire_path(wire, "b.ply"), NULL);
        snprintf(says, sizeof says, "comment points_without_attributes %zu\n", within);
        assert_non_null(strstr(text, says));
        free(text);
        text = wire_read(wire_path(wire, "err"), NULL);
        snprintf(says, sizeof says, "b.ply: %zu points without amplitude and width, which were lost\n", within);
        assert_non_null(strstr(text, says));
        free(text);
        memset(told + before, 0, within * sizeof told[0]);
        for (size_t k = before; k < before + within; k++)
            told[k].amplitude_db = -327.68;
        check_las(wire, "b.las");

        keep_told(wire, "a.shs");
        leave_out(wire, "a.shs", "b.shs", SCANHEAD_POINTS, which[i]);
        assert_int_equal(record(wire, stream, NULL, (const char *const[]){"b.ply", "b.las", NULL}), 1);
        assert_int_equal(stats_uint(wire, "seq_lost"), 1);
        memmove(told + before, told + before + within, (n_told - before - within) * sizeof told[0]);
        n_told -= within;
        check_ply(wire, "b.ply", 0, 0);
        check_las(wire, "b.las");
    }
}

/* 20 bytes a point fit through 1.216 MB/s at 60 kHz (test_usb_capacity.c), 24 only up to 50.7 kHz. */
static void test_capacity(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *set, *prr;
        int status;
    } cases[] = {{"output.attributes=off", "head.prr_hz=60000", 0},
                 {"output.attributes=on", "head.prr_hz=60000", 2},
                 {"output.attributes=on", "head.prr_hz=50000", 0}};
    char config[352];
    room_write(wire);
    wire_write_text(wire, "config.yaml",
                    "head: {profile: full-sweep, prr_hz: 50000, lines_hz: 50, pan_deg_s: 100, frames: 1}\n"
                    "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
                    "stations:\n  - {position_m: [0, 0, 0]}\n"
                    "links: [{type: usb, port: 0, speed: full}]\n");
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    for (int i = 0; i < 3; i++) {
        const char *const args[] = {"run",   config,       "--duration", "0.01",       "--pace",  "fast",
                                    "--set", cases[i].set, "--set",      cases[i].prr, "--quiet", NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), cases[i].status);
        if (cases[i].status == 0) continue;
        char *err = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(err,
                   "the stream has 1.44 MB/s, the link carries 1.22 MB/s; lower head.prr_hz to 50666, or leave out "
                   "output.attributes\n") == NULL)
            fail_msg("%s", err);
        free(err);
    }
}

/* The sums of the lines, as the library passes them on, are those that `record` reports. */
static void test_line_ends(void **state)
{
    struct wire *wire = *state;
    const char *config = begin(wire);
    struct scanhead_frame frame;
    struct scanhead_line_end end;
    uint64_t faint = 0, crowded = 0, echoes = 0, cast = 0, lines = 0;
    assert_int_equal(record(wire, config, "signal.reflectance=0.00001", (const char *const[]){"a.shs", NULL}), 0);
    struct scanhead *sh = open_stream(wire, "a.shs");
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type != SCANHEAD_LINE_END) {
            assert_int_equal(scanhead_line_end(sh, &frame, &end), SCANHEAD_EINPUT);
            continue;
        }
        assert_int_equal(scanhead_line_end(sh, &frame, &end), SCANHEAD_OK);
        assert_int_equal(end.scan_line, lines++);
        faint += end.n_faint;
        crowded += end.n_crowded;
        echoes += end.n_echoes;
        cast += end.n_cast;
    }
    scanhead_close(sh);
    assert_true(faint > 100);
    assert_int_equal(faint, stats_uint(wire, "faint_hits"));
    assert_int_equal(crowded, stats_uint(wire, "crowded_echoes"));
    assert_int_equal(echoes, stats_uint(wire, "points"));
    assert_int_equal(cast, stats_uint(wire, "pulses"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_off_and_on, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_files, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_live, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lost, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_capacity, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_line_ends, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
