/* SPDX-License-Identifier: MIT */
/* `scanhead record` and the files that it writes. Impossible ones are refused before anything is scanned. */
#include <dirent.h>
#include <sys/inotify.h>

#include "drivers/protocol/native_encode.h"

#include "tests/wire/room.h"

static const struct room_config SCAN = {.prr_hz = 20000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 60,
                                        .frames = 1,
                                        .links = "links: [{type: \"null\"}]\n"};

static int count_files(const struct wire *wire)
{
    int n = 0;
    DIR *dir = opendir(wire->dir);
    assert_non_null(dir);
    while (readdir(dir) != NULL)
        n++;
    closedir(dir);
    return n;
}

/* There is one line that says so, status 2, and no new file. */
static void expect_refusal(struct wire *wire, const char *const *args, const char *says)
{
    wire_write_text(wire, "out", "");
    wire_write_text(wire, "err", "");
    int before = count_files(wire), status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    char *text = wire_read(wire_path(wire, "err"), NULL), *end = strchr(text, '\n');
    if (status != 2 || strstr(text, says) == NULL || end == NULL || end[1] != 0)
        fail_msg("status %d, no '%s' in: %s", status, says, text);
    assert_int_equal(count_files(wire), before);
    free(text);
}

static void begin(struct wire *wire, char config[352])
{
    room_write(wire);
    snprintf(config, 352, "%s", room_config_write(wire, &SCAN));
}

/* Two names of one file would spoil it, and so would two recordings. */
static void test_same_file(void **state)
{
    struct wire *wire = *state;
    char config[352], a[352], b[352], part[352];
    begin(wire, config);
    snprintf(a, sizeof a, "%s", wire_path(wire, "a.las"));
    snprintf(b, sizeof b, "%s", wire_path(wire, "./a.las"));
    expect_refusal(wire, (const char *const[]){"record", config, "-o", a, "-o", a, NULL}, "given twice");
    expect_refusal(wire, (const char *const[]){"record", config, "-o", a, "-o", b, NULL},
                   "--output writes the same file");
    expect_refusal(wire, (const char *const[]){"record", config, "-o", a, "--truth", b, NULL},
                   "--output writes the same file");
    expect_refusal(wire, (const char *const[]){"record", config, "-o", a, "--stats", config, NULL}, "is also read as");
    /* The part that a killed recording left is not overwritten: it may be the only one. */
    snprintf(part, sizeof part, "%s", wire_write_text(wire, "a.las.part", "left behind, longer than nothing"));
    const char *const args[] = {"record", config, "-o", a, "--quiet", NULL};
    expect_refusal(wire, args, "a.las.part: an earlier recording left 32 bytes there; scanhead record --repair ");
    assert_int_equal(unlink(part), 0);
    wire_write_text(wire, "a-1.las.part", "left behind");
    expect_refusal(wire, (const char *const[]){"record", config, "-o", a, "--quiet", "--split", NULL}, "a-1.las.part");
    /* An earlier recording's second file is kept, too, also where it is there alone. */
    static const struct {
        const char *file, *left;
    } second[] = {{"b.las", "b.wdp.part"}, {"b.ptx", "b.ptx.grid"}};
    for (int i = 0; i < 2; i++) {
        char says[80], scan_left[40];
        snprintf(part, sizeof part, "%s", wire_write_text(wire, second[i].left, "left behind"));
        snprintf(b, sizeof b, "%s", wire_path(wire, second[i].file));
        snprintf(says, sizeof says, "%s: an earlier recording left 11 bytes there", second[i].left);
        expect_refusal(wire, (const char *const[]){"record", config, "-o", b, "--quiet", NULL}, says);
        char *kept = wire_read(part, NULL);
        assert_string_equal(kept, "left behind");
        free(kept);
        snprintf(scan_left, sizeof scan_left, "b-1%s", second[i].left + 1);
        wire_write_text(wire, scan_left, "left behind");
        expect_refusal(wire, (const char *const[]){"record", config, "-o", b, "--quiet", "--split", NULL}, scan_left);
    }
    snprintf(part, sizeof part, "%s", wire_path(wire, "a.las.part"));
    wire_write_text(wire, "a.las.part", ""); /* nothing is lost */
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    assert_int_equal(access(part, F_OK), -1);
    char *las = wire_read(a, NULL);
    assert_int_equal(strncmp(las, "LASF", 4), 0);
    free(las);
}

static void test_no_file(void **state)
{
    struct wire *wire = *state;
    static const char *const ending[] = {"las", "ptx", "e57", "ply", "poses.csv", "pcapng", "shs"};
    char config[352], name[64], path[352];
    begin(wire, config);
    for (int i = 0; i < 7; i++) {
        snprintf(name, sizeof name, "folder.%s", ending[i]);
        snprintf(path, sizeof path, "%s", wire_path(wire, name));
        assert_int_equal(mkdir(path, 0700), 0);
        expect_refusal(wire, (const char *const[]){"record", config, "-o", path, NULL}, "is a directory");
        assert_int_equal(rmdir(path), 0);
        snprintf(name, sizeof name, "none/a.%s", ending[i]);
        snprintf(path, sizeof path, "%s", wire_path(wire, name));
        expect_refusal(wire, (const char *const[]){"record", config, "-o", path, NULL}, "No such file or directory");
    }
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.xyz"));
    expect_refusal(wire, (const char *const[]){"record", config, "-o", path, NULL},
                   "allowed are .ply .las .ptx .e57 .poses.csv .waves.csv .pcapng .shs");
}

/* Formats with rigid poses take no degrees, and report that before the scan. */
static void test_degrees(void **state)
{
    struct wire *wire = *state;
    static const char *const ending[] = {"ptx", "e57"};
    char config[352], name[64], path[352];
    begin(wire, config);
    for (int i = 0; i < 2; i++) {
        snprintf(name, sizeof name, "a.%s", ending[i]);
        snprintf(path, sizeof path, "%s", wire_path(wire, name));
        const char *const args[] = {"record",  config,
                                    "-o",      path,
                                    "--crs",   "geodetic",
                                    "--set",   "output.layout=geo",
                                    "--set",   "stations[0].lat_deg=50",
                                    "--set",   "stations[0].lon_deg=8",
                                    "--set",   "stations[0].height_m=100",
                                    "--quiet", NULL};
        expect_refusal(wire, args, "this format holds metres, and output.crs is geodetic; allowed local, ecef, utm");
    }
}

/* --crs demands points in that system. There is no recording in the scene frame instead. */
static void test_crs(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352];
    begin(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.ply"));
    const char *args[] = {"record",  config,
                          "-o",      path,
                          "--crs",   "utm",
                          "--set",   "stations[0].lat_deg=50",
                          "--set",   "stations[0].lon_deg=8",
                          "--set",   "stations[0].height_m=100",
                          "--quiet", NULL,
                          NULL,      NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *ply = wire_read(path, NULL);
    assert_non_null(strstr(ply, "\ncomment epsg 32632\n")); /* 6 to 12 degrees east is zone 32 */
    free(ply);
    remove(path);
    args[13] = "--set";
    args[14] = "output.layout=polar";
    expect_refusal(wire, args, "output.layout is polar");
}

/* --duration ends each scan, but not the row of stations. */
static void test_duration_of_each(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352], stats[352];
    begin(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.ply"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record",  config,       "-o",      path,    "--station",
                                "all",     "--duration", "0.05",    "--set", "stations.1.position_m=[1, 0, 0]",
                                "--stats", stats,        "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    assert_int_equal(stats_uint(wire, "scans"), 2);
}

/* Off line nothing but the configuration decides when a scan begins, however long the threads take. Where a command's
 * time depended on them, half of the runs differed. */
static void test_same_time_in_each_run(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352], *first = NULL;
    size_t first_len = 0, len;
    begin(wire, config);
    for (int i = 0; i < 8; i++) {
        snprintf(path, sizeof path, "%s", wire_path(wire, "a.shs"));
        const char *const args[] = {"record",  config,       "-o",   path,    "--station",
                                    "all",     "--duration", "0.01", "--set", "stations.1.position_m=[1, 0, 0]",
                                    "--quiet", NULL};
        wire_run(wire, args, 0);
        char *bytes = wire_read(path, &len);
        if (first == NULL) {
            first = bytes;
            first_len = len;
            continue;
        }
        assert_int_equal(len, first_len);
        assert_memory_equal(bytes, first, len);
        free(bytes);
    }
    free(first);
}

/* ---- completing a file */

/* Writes a frame of len bytes, with its number in the file. */
static void put_numbered(FILE *out, uint8_t *frame, size_t len, uint32_t seq)
{
    assert_true(len > 0);
    native_finish_frame(frame, seq);
    assert_int_equal(fwrite(frame, 1, len, out), len);
}

static void put_shot(FILE *out, uint32_t seq, uint32_t line, uint64_t pulse0)
{
    static uint8_t buf[1024];
    uint32_t x[1] = {1000}, dt_ns[1] = {0};
    int16_t refl_cdb[1] = {0};
    uint16_t label[1] = {0};
    uint8_t echo[1] = {0x11};
    struct line_block block = {.line = line,
                               .pulse0 = pulse0,
                               .n_pulses = 1,
                               .n_points = 1,
                               .dt_ns = dt_ns,
                               .a = x,
                               .b = x,
                               .c = x,
                               .refl_cdb = refl_cdb,
                               .echo = echo,
                               .label = label};
    put_numbered(out, buf, native_encode_points(buf, sizeof buf, &block, 0), seq);
}

/* Writes a scan whose descriptor has no end, and a shot in each of two lines of it. Returns the file's size. */
static size_t write_two_lines(const struct wire *wire, const char *name, uint32_t line)
{
    static uint8_t buf[1024];
    struct native_descriptor d = {.idn = "a,b,c,d", .layout = NATIVE_GEO, .prr_uhz = 1000000, .lines_uhz = 1000000};
    struct native_anchor a = {.station = 1, .scale_m = 1e-3, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    FILE *out = fopen(wire_path(wire, name), "wb");
    assert_non_null(out);
    put_numbered(out, buf, native_encode_descriptor(buf, sizeof buf, &d, 0, 0), 0);
    put_numbered(out, buf, native_encode_anchor(buf, sizeof buf, &a, 0, 0), 1);
    put_shot(out, 2, 0, 0);
    put_shot(out, 3, line, line);
    const struct native_event end = {.code = NATIVE_EV_SCAN_END, .b = 2};
    put_numbered(out, buf, native_encode_event(buf, sizeof buf, &end, 0, 0), 4);
    const size_t len = (size_t)ftell(out);
    assert_int_equal(fclose(out), 0);
    return len;
}

/* A kilobyte of stream has lines 0 and 2^32 - 1. The .ptx has no 43 GB of empty places between them. */
static void test_lines_far_apart(void **state)
{
    struct wire *wire = *state;
    char stream[352], ptx[352];
    struct stat st;
    assert_true(write_two_lines(wire, "a.shs", UINT32_MAX) < 1100);
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "a.shs"));
    snprintf(ptx, sizeof ptx, "%s", wire_path(wire, "a.ptx"));
    const char *const args[] = {"record", stream, "-o", ptx, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    assert_int_equal(stat(ptx, &st), 0);
    assert_in_range(st.st_size, 1, 2000);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "1 additional grids begun within a scan"));
    free(err);
}

/* A stream ends within its scan, as that of a killed recorder. The stream's statistics are there all the same. */
static void test_end_within_scan(void **state)
{
    struct wire *wire = *state;
    char stream[352], ply[352], stats[352];
    static uint8_t event[1024];
    const struct native_event end = {.code = NATIVE_EV_SCAN_END, .b = 2};
    const size_t len = write_two_lines(wire, "a.shs", 1),
                 end_len = native_encode_event(event, sizeof event, &end, 0, 0);
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "a.shs"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "a.ply"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    assert_int_equal(truncate(stream, (off_t)(len - end_len)), 0);
    const char *const args[] = {"record", stream, "-o", ply, "--stats", stats, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 1);
    assert_int_equal(stats_uint(wire, "points"), 2);
    assert_int_equal(stats_uint(wire, "scans"), 0);
}

/* A stream's head is known only when its frames come. The first points have no place in a .ptx: earlier recordings
 * stay, of the other format, too. */
static void test_refused_by_one(void **state)
{
    struct wire *wire = *state;
    char config[352], stream[352], path[2][352];
    room_write(wire);
    snprintf(
        config, sizeof config, "%s",
        wire_write_text(wire, "beams.yaml",
                        "head: {profile: velodyne-vlp16}\n"
                        "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 0]}]\n"));
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "a.shs"));
    snprintf(path[0], sizeof path[0], "%s", wire_write_text(wire, "a.las", "earlier"));
    snprintf(path[1], sizeof path[1], "%s", wire_write_text(wire, "a.ptx", "earlier"));
    const char *const args[] = {"record", config, "-o", stream, "--duration", "0.02", "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    for (int first = 0; first < 2; first++) {
        const char *const again[] = {"record", stream, "-o", path[first], "-o", path[!first], "--quiet", NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, again, "out", "err", -1)), 1);
        for (int i = 0; i < 2; i++) {
            char *text = wire_read(path[i], NULL);
            assert_string_equal(text, "earlier");
            free(text);
        }
    }
}

/* Returns whether a grid has text. An empty one of 4 bytes is there from the first shot on, before the file is
 * completed. */
static int has_grid(const struct wire *wire, const char *name)
{
    struct stat st = {0};
    return stat(wire_path(wire, name), &st) == 0 && st.st_size > 4;
}

static int has_percent(const struct wire *wire, const char *name)
{
    char *text = access(wire_path(wire, name), F_OK) == 0 ? wire_read(wire_path(wire, name), NULL) : NULL;
    int has = text != NULL && strchr(text, '%') != NULL;
    free(text);
    return has;
}

/* Waits for writes to the file until the condition holds. */
static void wait_for(const struct wire *wire, const char *name, int (*is_so)(const struct wire *, const char *))
{
    _Alignas(struct inotify_event) char buf[4096];
    struct pollfd p = {.fd = inotify_init1(IN_CLOEXEC), .events = POLLIN};
    assert_true(inotify_add_watch(p.fd, wire->dir, IN_MODIFY) >= 0);
    while (!is_so(wire, name)) {
        assert_int_equal(poll(&p, 1, DEADLINE_MS), 1);
        assert_true(read(p.fd, buf, sizeof buf) > 0);
    }
    close(p.fd);
}

/* Three grids of 16 million places take seconds to write, one after the other. A signal ends that, and leaves nothing
 * of the incomplete ones. */
static void test_signal_while_completing(void **state)
{
    struct wire *wire = *state;
    static const char *const part[] = {"0.ptx.part", "1.ptx.part", "2.ptx.part"};
    char stream[352], ptx[3][352];
    write_two_lines(wire, "a.shs", 16000000);
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "a.shs"));
    for (int i = 0; i < 3; i++)
        snprintf(ptx[i], sizeof ptx[i], "%s/%d.ptx", wire->dir, i);
    const char *const args[] = {"record", stream, "-o", ptx[0], "-o", ptx[1], "-o", ptx[2], "--quiet", NULL};
    pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    wait_for(wire, part[0], has_grid);
    assert_int_equal(kill(pid, SIGTERM), 0);
    assert_int_equal(wire_wait(wire, pid), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, ".ptx: interrupted while it was completed"));
    free(err);
    assert_int_equal(access(ptx[2], F_OK), -1);
    for (int i = 0; i < 3; i++)
        assert_int_equal(access(wire_path(wire, part[i]), F_OK), -1);
}

/* The first of two stations takes long. Less than half of it is done at the first report, after a second, and the share
 * is known. */
static void test_percent(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352];
    unsigned percent;
    begin(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.shs"));
    const char *const args[] = {"record", config,     "-o",     path,    "--station",
                                "all",    "--frames", "100000", "--set", "stations.1.position_m=[1, 0, 0]",
                                NULL};
    wire_write_text(wire, "err", "");
    pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    wait_for(wire, "err", has_percent);
    assert_int_equal(kill(pid, SIGTERM), 0);
    assert_int_equal(wire_wait(wire, pid), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL), *at = strstr(err, " M pulses: ");
    if (at == NULL || sscanf(at, " M pulses: %u %%", &percent) != 1 || percent >= 50) fail_msg("%s", err);
    free(err);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_degrees, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_crs, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_duration_of_each, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_same_time_in_each_run, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_percent, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lines_far_apart, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end_within_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refused_by_one, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_signal_while_completing, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("record files", tests, NULL, NULL);
}
