/* SPDX-License-Identifier: MIT */
/* Heads that are no line heads, while they scan. Settings change, and rates follow from others. */
#include "tests/wire/emitter_rig.h"
#include "tests/wire/room.h"

enum { MAX_POINTS = 4096 };

struct live {
    struct scanhead *sh;
    uint64_t points, next;
    int emitters, echoes;       /* of the emitter frames that came: how many, and what the last one said */
    double lines_hz;            /* of the last descriptor */
    uint64_t change[8];         /* first pulses with new settings */
    int n_changes, lines_to[8]; /* in tenths, as asked for */
};

/* Returns the turns up to a firing time, from the times of the changes alone. There are ten turns a second until the
 * first change, then as many as commanded. */
static double turned(const struct live *live, int64_t t_ns)
{
    double turns = 0, lines_hz = 10;
    int64_t from_ns = 0;
    for (int i = 0; i < live->n_changes; i++) {
        struct shot s;
        shot_vlp(live->change[i], &s);
        if (s.t_ns > t_ns) break;
        turns += lines_hz * 1e-9 * (double)(s.t_ns - from_ns);
        from_ns = s.t_ns;
        if (live->lines_to[i] != 0) lines_hz = 0.1 * live->lines_to[i];
    }
    return turns + lines_hz * 1e-9 * (double)(t_ns - from_ns);
}

/* The azimuth goes on through each change, and so do the firings. */
static void check_live(struct live *live, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[MAX_POINTS];
    assert_int_equal(scanhead_points(live->sh, frame, 0, point, MAX_POINTS), frame->n_points);
    assert_int_equal(frame->pulse0, live->next); /* none lost or doubled */
    for (uint32_t i = 0; i < frame->n_points; i++) {
        struct shot s;
        shot_vlp(frame->pulse0 + i, &s);
        assert_int_equal(point[i].t_ns, s.t_ns);
        assert_true(fabs(point[i].mirror_rad - s.elevation_deg * M_PI / 180) < ANGLE_RAD);
        const double off_rad = remainder(point[i].pan_rad - 2 * M_PI * turned(live, s.t_ns), 2 * M_PI);
        assert_true(fabs(off_rad) < ANGLE_RAD);
    }
    live->next += frame->n_points;
}

static void take_live(struct live *live)
{
    struct scanhead_frame frame;
    struct scanhead_info info;
    static struct scanhead_emitter e;
    while (scanhead_next(live->sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_EMITTER && scanhead_get_emitter(live->sh, &e) == SCANHEAD_OK) {
            live->emitters++;
            live->echoes = e.echoes;
        }
        if (frame.type == SCANHEAD_ANCHOR && scanhead_get_info(live->sh, &info) == 0) live->lines_hz = info.lines_hz;
        if (is_event(&frame, SCANHEAD_EV_SETTINGS)) live->change[live->n_changes++] = frame.event_value[0];
        if (frame.type == SCANHEAD_POINTS) check_live(live, &frame);
    }
}

static void step(struct live *live, const char *command, int lines_to)
{
    char line[32];
    live->lines_to[live->n_changes] = lines_to;
    if (command != NULL) client_tell(live->sh, command);
    snprintf(line, sizeof line, "TIME:STEP %d MS", 83 + 10 * live->n_changes);
    client_tell(live->sh, line);
    take_live(live);
}

static void turns_change_within_a_scan(void **state)
{
    struct wire *wire = *state;
    const char *const more[] = {"--pace", "step", NULL};
    const struct room_config c = {.profile = "velodyne-vlp16",
                                  .prr_hz = 289351.851852,
                                  .lines_hz = 10,
                                  .links = LINK_YAML_TCP,
                                  .more = "loop: {queue_ms: 2000}\n"};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &c), more);
    struct live live = {.sh = client_open(head_endpoint(&head, "tcp"))};
    char hash[65], want[65];
    scanhead_hash_start(live.sh);
    while (strcmp(client_ask(live.sh, "HEAD:STAT?"), "idle") != 0)
        client_tell(live.sh, "TIME:STEP 50 MS");
    take_live(&live);
    client_tell(live.sh, "SCAN:STAR");
    client_tell(live.sh, "TIME:STEP 30 MS"); /* the mirror comes to speed */
    take_live(&live);
    step(&live, NULL, 0);
    step(&live, "HEAD:LINES 17.3", 173);
    assert_true(live.lines_hz == 17.3);
    step(&live, "HEAD:LINES 5", 50);
    const int before = live.emitters;
    step(&live, "SCAN:ECH STR", 0);
    assert_int_equal(live.emitters, before + 1);
    assert_int_equal(live.echoes, 3);
    step(&live, "HEAD:LINES 20", 200);
    step(&live, "SCAN:ECH ALL", 0);
    assert_int_equal(live.echoes, 0);
    assert_int_equal(live.n_changes, 5);
    assert_true(live.next > 100000);
    /* A head that fires at its own times takes no other rate. */
    assert_string_equal(client_ask(live.sh, "HEAD:PRR?"), "289351.851852");
    assert_non_null(strstr(client_ask(live.sh, "HEAD:PRR 300000"), "allowed 289351.851852\""));
    client_tell(live.sh, "SCAN:STOP");
    client_tell(live.sh, "TIME:STEP 500 MS");
    take_live(&live);
    scanhead_hash_hex(live.sh, hash);
    scanhead_close(live.sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, want);
    assert_string_equal(hash, want);
}

/* The pulse rate of a planar head follows from its turns. */
static void a_planar_heads_rate_follows(void **state)
{
    struct wire *wire = *state;
    const struct room_config c = {
        .profile = "hokuyo-urg-04lx", .prr_hz = 10240, .lines_hz = 10, .links = LINK_YAML_TCP};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &c), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "HEAD:LINES 9.5");
    assert_string_equal(client_ask(sh, "HEAD:PRR?"), "9728");
    assert_non_null(strstr(client_ask(sh, "HEAD:PRR 10240"), "allowed 9728 as HEAD:LINes is 9.5"));
    client_tell(sh, "HEAD:PRR 9728");
    assert_non_null(strstr(client_ask(sh, "HEAD:LINES 11"), "allowed 9 to 10"));
    assert_non_null(strstr(client_ask(sh, "HEAD:PAN 1"), "allowed 0\""));
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(turns_change_within_a_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_planar_heads_rate_follows, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
