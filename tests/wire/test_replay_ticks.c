/* SPDX-License-Identifier: MIT */
/* A replayed recording has the timing of the head. In the pace step, where each tick is granted by itself, each frame
 * comes with the same tick, and all bytes are the same. */
#include "tests/wire/emitter_rig.h"
#include "tests/wire/replay_rig.h"

/* A head boots, spins up, scans and spins down. The head is recorded to the last tick, and replayed with some more. */
static void same_ticks_with(struct wire *wire, const struct room_config *c, const char *const *options,
                            const struct tape_line *lines, int n)
{
    const struct tape_line start[] = {{3, "SCAN:STARt"}, {0, NULL}};
    const char *const link[] = {"--link", "type: tcp, port: 0", NULL};
    struct room_config config = *c;
    struct tape head = {0}, replay = {0};
    char file[352];
    room_write(wire);
    config.links = LINK_YAML_TCP;
    tape_step(wire, room_config_write(wire, &config), options, lines, n, &head);
    snprintf(file, sizeof file, "%s", tape_write(wire, "head.shs", &head));
    tape_step(wire, file, link, start, n + 10, &replay);
    tape_keep_common(&head);
    tape_keep_common(&replay);
    assert_true(head.n > 50);
    tape_same_ticks(&replay, &head);
    tape_free(&head);
    tape_free(&replay);
}

static void same_ticks(struct wire *wire, const struct room_config *c, const struct tape_line *lines, int n)
{
    static const char *const threads[] = {"--threads", "1", NULL};
    same_ticks_with(wire, c, threads, lines, n);
}

/* 32.5 of 100 degrees are cast, so a line's packets end before it does. */
static void test_line_head_with_a_blind_part(void **state)
{
    static const struct room_config config = {.prr_hz = 10000,
                                              .lines_hz = 33.3,
                                              .pan_deg_s = 50,
                                              .pan_stop_deg = 20,
                                              .line_start_deg = -10.3,
                                              .line_stop_deg = 22.2,
                                              .frames = 2};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    same_ticks(*state, &config, lines, 1500);
}

/* Fast pulses in a mirror of three facets, with attributes and colours. */
static void test_line_head_of_any_rate(void **state)
{
    static const struct room_config config = {.profile = "any-rate",
                                              .prr_hz = 123456.789,
                                              .lines_hz = 97.7,
                                              .pan_deg_s = 150,
                                              .pan_stop_deg = 30,
                                              .frames = 1,
                                              .more = "output: {attributes: true, colour: range}\n"};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    same_ticks(*state, &config, lines, 700);
}

/* Rates change within lines, and the scan is stopped within one; then another follows. */
static void test_changes_and_a_stop(void **state)
{
    static const struct room_config config = {
        .prr_hz = 10000, .lines_hz = 13.7, .pan_deg_s = 50, .pan_stop_deg = 50, .frames = 0};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"},      {433, "HEAD:PRR 12345.678"},
                                             {479, "HEAD:LINes 33.3"}, {555, "SCAN:LINE:STOP 31.25"},
                                             {601, "HEAD:PRR 77777"},  {602, "HEAD:PRR 7777"},
                                             {711, "SCAN:STOP"},       {1200, "SCAN:STARt"},
                                             {1261, "SCAN:STOP"},      {0, NULL}};
    same_ticks(*state, &config, lines, 1500);
}

static void test_beams(void **state)
{
    static const struct room_config config = {
        .profile = "velodyne-vlp16", .prr_hz = 289351.851852, .lines_hz = 10, .frames = 3};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    same_ticks(*state, &config, lines, 700);
}

static void test_one_plane(void **state)
{
    static const struct room_config config = {.profile = "sick-tim571", .prr_hz = 16200, .lines_hz = 15, .frames = 4};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    same_ticks(*state, &config, lines, 700);
}

static void test_a_sphere(void **state)
{
    static const struct room_config config = {.profile = "own.yaml", .prr_hz = 1440, .lines_hz = 40, .frames = 1};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    emitter_write_profile(*state, "emitter: sphere\nstep_deg: {value: 10, from: assumed}\n");
    same_ticks(*state, &config, lines, 1000);
}

/* Poses come between the points whose places they give. */
static void test_a_head_that_moves(void **state)
{
    static const struct room_config config = {
        .prr_hz = 10000,
        .lines_hz = 33.3,
        .pan_deg_s = 50,
        .pan_stop_deg = 10,
        .line_start_deg = -10,
        .line_stop_deg = 22,
        .frames = 1,
        .more = "platform: {kind: trajectory, file: ride.csv}\noutput: {layout: geo, crs: local, scale_m: 1e-6}\n"};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    wire_write_text(
        *state, "ride.csv",
        "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,0,0,0,0,0,0\n0.07,0.1,0,0,0,1,20\n0.31,1,0,0.1,0,0,90\n");
    same_ticks(*state, &config, lines, 800);
}

/* There are one or two pulses in a tick. So they have a frame of their own, at whose start the mesh is moved, and the
 * last packet of a line has many frames. */
static void test_a_mesh_that_moves(void **state)
{
    static const struct room_config config[] = {
        {.prr_hz = 1000, .lines_hz = 12.3, .pan_deg_s = 20, .pan_stop_deg = 20, .frames = 1},
        {.profile = "own.yaml", .prr_hz = 1440, .lines_hz = 40, .frames = 1}};
    static const struct tape_line lines[] = {{330, "SCAN:STARt"}, {0, NULL}};
    char file[384];
    snprintf(file, sizeof file, "scene.meshes[1].file=%s", wire_path(*state, "gate.obj"));
    const char *const options[] = {"--threads", "1",
                                   "--set",     file,
                                   "--set",     "scene.meshes[1].scale=1",
                                   "--set",     "scene.meshes[1].up=z",
                                   "--set",     "scene.meshes[1].move_m_s=[1,0,0]",
                                   NULL};
    wire_write_text(*state, "gate.obj", "v 0 1 -1\nv 1 1 -1\nv 0 1 1\no gate\nf 1 2 3\n");
    emitter_write_profile(*state, "emitter: sphere\nstep_deg: {value: 10, from: assumed}\n");
    for (int i = 0; i < 2; i++)
        same_ticks_with(*state, &config[i], options, lines, i == 0 ? 1600 : 1000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_line_head_with_a_blind_part, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_line_head_of_any_rate, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_changes_and_a_stop, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_beams, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_one_plane, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_sphere, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_head_that_moves, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_mesh_that_moves, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
