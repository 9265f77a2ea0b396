/* SPDX-License-Identifier: MIT */
/* Files, plan, map and report of heads that are no line heads. */
#include "tests/wire/emitter_rig.h"
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

static const char *write_config_with(struct wire *wire, const char *profile, double prr_hz, double lines_hz,
                                     unsigned frames, const char *links)
{
    const struct room_config c = {
        .profile = profile, .prr_hz = prr_hz, .lines_hz = lines_hz, .frames = frames, .links = links};
    static char path[128];
    room_write(wire);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &c));
    return path;
}

static const char *write_config(struct wire *wire, const char *profile, double prr_hz, double lines_hz, unsigned frames)
{
    return write_config_with(wire, profile, prr_hz, lines_hz, frames, "links: []\n");
}

static void assert_said(const struct wire *wire, const char *file, const char *words)
{
    char *text = wire_read(wire_path(wire, file), NULL);
    if (strstr(text, words) == NULL) fail_msg("%s says nothing of %s", text, words);
    free(text);
}

static int record_as(struct wire *wire, const char *config, const char *name)
{
    const char *const args[] = {"record", config, "-o", wire_path(wire, name), "--quiet", NULL};
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

/* The first two lines are the columns and rows. */
static void assert_grid(const struct wire *wire, const char *columns_rows)
{
    char *text = wire_read(wire_path(wire, "a.ptx"), NULL);
    if (strncmp(text, columns_rows, strlen(columns_rows)) != 0) fail_msg("%.20s", text);
    free(text);
    unlink(wire_path(wire, "a.ptx"));
}

/* Each turn is a column and each cast step a row; nothing is filled up. */
static void grids_of_planar_heads(void **state)
{
    assert_int_equal(record_as(*state, write_config(*state, "hokuyo-ust-20lx", 57600, 40, 7), "a.ptx"), 0);
    assert_grid(*state, "7\n1081\n");
    assert_int_equal(record_as(*state, write_config(*state, "sick-tim571", 16200, 15, 3), "a.ptx"), 0);
    assert_grid(*state, "3\n811\n");
}

static void beams_have_no_grid(void **state)
{
    const char *config = write_config(*state, "velodyne-vlp16", 289351.851852, 20, 2);
    struct wire *wire = *state;
    char ply[256];
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "a.ply"));
    const char *const args[] = {"record", config, "-o", ply, "-o", wire_path(wire, "a.ptx"), "--quiet", NULL};
    wire_run(wire, args, 2);
    assert_said(wire, "err", "a.ptx: a grid has rows and columns, but this head fires beams in turn; allowed are .ply");
    assert_int_equal(access(ply, F_OK), -1); /* refused before a file is begun */
}

/* Two turns of 50 ms of a VLP-16 are 1808 sequences of 16, and 11 firings of the next. */
static void other_formats_take_them(void **state)
{
    struct wire *wire = *state;
    static const char *const name[] = {"a.las", "a.e57", "a.ply", "a.pcapng", "a.shs"};
    const char *config = write_config(wire, "velodyne-vlp16", 289351.851852, 20, 2);
    for (size_t i = 0; i < sizeof name / sizeof name[0]; i++)
        assert_int_equal(record_as(wire, config, name[i]), 0);
    assert_said(wire, "a.ply", "element vertex 28939\n");
    const char *const report[] = {"report", config, wire_path(wire, "a.ply"), NULL};
    wire_run(wire, report, 0);
    assert_said(wire, "out", "points     28939\n");
    assert_said(wire, "out", "beyond     0 farther than 0.001 m\n");
    const char *const map[] = {"map", config, "-o", wire_path(wire, "a.png"), "--quiet", NULL};
    wire_run(wire, map, 0);
}

/* b.shs is a.shs without its line ends, as if they were lost. */
static void lose_line_ends(struct wire *wire)
{
    size_t len, kept = 0;
    char *bytes = wire_read(wire_path(wire, "a.shs"), &len);
    for (size_t at = 0; at < len;) {
        const uint8_t *frame = (const uint8_t *)bytes + at;
        const size_t size = native_frame_len(frame);
        if (frame[1] != NATIVE_LINE_END) {
            memmove(bytes + kept, frame, size);
            kept += size;
        }
        at += size;
    }
    assert_true(kept < len);
    wire_write(wire, "b.shs", bytes, kept);
    free(bytes);
}

/* E57 has the number of each shot in its line. Without the line ends, it follows from the exact firing times. */
static void shots_are_counted_without_line_ends(void **state)
{
    struct wire *wire = *state;
    size_t n[2];
    char source[128];
    emitter_write_profile(wire, "emitter: beams\nfiring_ns: {value: 30000, from: assumed}\nbeams:\n"
                                "  - {elevation_deg: -9, offset_ns: 0, from: assumed}\n"
                                "  - {elevation_deg: 0, offset_ns: 100, from: assumed}\n"
                                "  - {elevation_deg: 9, offset_ns: 250, from: assumed}\n");
    assert_int_equal(record_as(wire, write_config(wire, "own.yaml", 100000, 17.3, 3), "a.shs"), 0);
    lose_line_ends(wire);
    for (int i = 0; i < 2; i++) {
        snprintf(source, sizeof source, "%s", wire_path(wire, i == 0 ? "a.shs" : "b.shs"));
        assert_int_equal(record_as(wire, source, i == 0 ? "a.e57" : "b.e57"), i); /* the second one is not complete */
    }
    char *with = wire_read(wire_path(wire, "a.e57"), &n[0]), *without = wire_read(wire_path(wire, "b.e57"), &n[1]);
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(with, without, n[0]);
    free(with);
    free(without);
}

static void plan_and_check_name_the_emitter(void **state)
{
    struct wire *wire = *state;
    const char *config = write_config(wire, "velodyne-vlp16", 289351.851852, 20, 2);
    const char *const check[] = {"check", config, NULL}, *const plan[] = {"plan", config, "--json", NULL};
    wire_run(wire, check, 0);
    assert_said(wire, "out", "emitter   beams, 16 in a sequence of 55296 ns, turning clockwise\n");
    wire_run(wire, plan, 0);
    assert_said(wire, "out", "\"stage\": \"emitter\",\n    \"method\": \"beams\"");
    config = write_config(wire, "hokuyo-urg-04lx", 10240, 10, 1);
    const char *const planar[] = {"check", config, NULL};
    wire_run(wire, planar, 0);
    assert_said(wire, "out", "emitter   planar, steps 44..725 of 1024 a turn, 384 ahead, counter-clockwise\n");
}

/* A protocol's demands on the stream are for clients on the wire. */
static void links_forbid_no_map(void **state)
{
    struct wire *wire = *state;
    const char *config =
        write_config_with(wire, "hokuyo-ust-20lx", 57600, 40, 1, "links: [{type: tcp, protocol: scip, port: 0}]\n");
    const char *const map[] = {"map", config, "-o", wire_path(wire, "a.png"), "--quiet", NULL};
    wire_run(wire, map, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(grids_of_planar_heads, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(beams_have_no_grid, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(other_formats_take_them, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(shots_are_counted_without_line_ends, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(plan_and_check_name_the_emitter, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(links_forbid_no_map, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
