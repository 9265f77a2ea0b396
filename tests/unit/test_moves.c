/* SPDX-License-Identifier: MIT */
/* These are tests of SITE:POSE in the device, without threads. A scan from a moved station has the bytes of one whose
 * configuration has that place. Shared parts stay, unused ones are freed once, and a failed move changes nothing. */
#include "tests/unit/device_rig.h"

#include <math.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/device/device_state.h"

/* A frame of 10 degrees: 55 ms, 16,667 pulses. */
#define SHORT "head.pan_stop_deg=10", "head.frames=1"
/* Each station has a map, whether it pays or not. */
#define MAPS "cast.sight=on", "cast.sight_mib=1"

#define TRIPOD "stations[0].tripod.leg_m=2.5", "stations[0].tripod.head_above_m=0.2"

/* ---- a session by hand */

/* Moves as the loop does, and returns the reply. */
static const char *move(struct rig *rig, const char *line)
{
    static struct command_result result;
    device_command(rig->device, 1, line, rig->next, &result);
    if (result.effect != COMMAND_MOVE) return result.reply;
    device_plan_move(rig->device);
    device_finish_move(rig->device, rig->next, &result);
    return result.reply;
}

static void expect_moved(struct rig *rig, const char *line)
{
    const char *reply = move(rig, line);
    if (strcmp(reply, "OK") != 0) fail_msg("%s: %s", line, reply);
}

static void expect_refused(struct rig *rig, const char *line, int number, const char *why)
{
    char begin[16];
    const char *reply = move(rig, line);
    snprintf(begin, sizeof begin, "ERR %d,", number);
    if (strncmp(reply, begin, strlen(begin)) != 0 || strstr(reply, why) == NULL)
        fail_msg("%s: %s; expected %s ... %s", line, reply, begin, why);
}

static struct rig *rig_idle(const struct device_options *options, const char *const *sets, int n_sets)
{
    struct rig *rig = rig_open(options, sets, n_sets);
    struct sh_err err;
    need(site_open_sights(rig->site, 0, rig->site->n_stations, NULL, &err), &err);
    rig_go_to(rig, 300); /* it boots for 200 ms */
    return rig;
}

struct bytes {
    uint8_t *at;
    size_t len;
};

/* Takes the bytes that stream_sha256 includes, of the ticks up to the scan's end. */
static struct bytes take_scan(struct rig *rig)
{
    struct bytes b = {NULL, 0};
    for (int over = 0; !over;) {
        assert_true(rig_claim(rig));
        const struct ring_tick *tick = rig_fill(rig);
        b.at = realloc(b.at, b.len + tick->len + 1);
        assert_non_null(b.at);
        for (uint32_t at = 0; at < tick->len;) {
            struct native_header header;
            uint8_t *frame = tick->bytes + at;
            const size_t n = native_frame_len(frame);
            native_read_header(frame, &header);
            if (native_is_hashed(&header)) {
                memcpy(b.at + b.len, frame + NATIVE_HEADER_LEN, header.length);
                b.len += header.length;
            }
            at += (uint32_t)n;
        }
        over = rig_event(rig, NATIVE_EV_SCAN_END) != NULL;
    }
    return b;
}

static struct bytes scan(struct rig *rig)
{
    assert_string_equal(rig_tell(rig, "SCAN:STARt", rig->next), "OK");
    return take_scan(rig);
}

static void expect_same(const struct bytes *a, const struct bytes *b)
{
    assert_true(a->len > 100000); /* 16,667 pulses, 6 bytes and more each */
    assert_int_equal(a->len, b->len);
    assert_memory_equal(a->at, b->at, a->len);
}

/* ---- any way to a place is the same */

static void compare(const char *const *more, int n_more, const char *place, const char *const keys[4])
{
    const char *sets[16] = {SHORT}, *at[16] = {SHORT};
    char line[128];
    int n = 2;
    for (int i = 0; i < n_more; i++, n++)
        sets[n] = at[n] = more[i];
    for (int i = 0; i < 4; i++)
        at[n + i] = keys[i];
    struct rig *moved = rig_idle(NULL, sets, n), *there = rig_idle(NULL, at, n + 4);
    snprintf(line, sizeof line, "SITE:POSE 1,%s", place);
    expect_moved(moved, line);
    struct bytes a = scan(moved), b = scan(there);
    expect_same(&a, &b);
    free(a.at);
    free(b.at);
    rig_close(moved);
    rig_close(there);
}

/* The place is high up and near two walls: the first place sees the floor where this one sees a wall. */
static void a_scan_has_the_bytes_of_a_configuration_with_that_place(void **state)
{
    (void)state;
    static const char *const keys[4] = {"stations[0].position_m=[3, 3.5, 2]", "stations[0].heading_deg=33.5",
                                        "stations[0].pitch_deg=4", "stations[0].roll_deg=-3"};
    static const char place[] = "3 M, 3.5, 2, 33.5 DEG, 4, -3";
    compare(NULL, 0, place, keys);
    compare((const char *const[]){MAPS}, 2, place, keys);
    compare((const char *const[]){"output.crs=utm", "scene.anchor.source=explicit", "scene.anchor.lat_deg=47",
                                  "scene.anchor.lon_deg=8", "scene.anchor.height_m=400"},
            5, place, keys);
    compare((const char *const[]){TRIPOD, "stations[0].tripod.legs=on"}, 3, place, keys);
}

static void what_is_read_can_be_sent_back(void **state)
{
    (void)state;
    char line[COMMAND_MAX_LINE + 1];
    struct rig *rig = rig_idle(NULL, NULL, 0);
    expect_moved(rig, "SITE:POSE 2, 0.1, 1e-7, -0.333333333333333314829616256247, 359.999999999999, -90, 180");
    const char *place = rig_tell(rig, "SITE:POSE? 2", rig->next);
    assert_string_equal(place, "0.1,1e-07,-0.3333333333333333,359.999999999999,-90,180");
    double before[3];
    memcpy(before, rig->device->site->station[1].at.position_m, sizeof before);
    assert_true(before[0] == 0.1 && before[2] == -0.333333333333333314829616256247);
    snprintf(line, sizeof line, "SITE:POSE 2,%s", place);
    const struct site *was = rig->device->site;
    expect_moved(rig, line);
    assert_ptr_equal(rig->device->site, was); /* it stands there already */
    expect_moved(rig, "SITE:POSE 2, DEF");
    assert_string_equal(rig_tell(rig, "SITE:POSE? 2", rig->next), "0.5,0,0,0,0,0");
    assert_string_equal(rig_tell(rig, "SITE:POSE? 2, MAX", rig->next), "1000000000,1000000000,1000000000,360,90,180");
    rig_close(rig);
}

/* ---- shared, and freed */

static void the_bvh_and_the_maps_of_others_stay(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT, MAPS};
    struct rig *rig = rig_idle(NULL, sets, 4);
    const struct device *device = rig->device;
    struct bvh *first = device->site->bvh;
    const struct sight *other = device->site->station[1].sight;
    assert_true(other != NULL && device->site->station[0].sight != NULL);
    for (int i = 0; i < 5; i++) {
        char line[64];
        snprintf(line, sizeof line, "SITE:POSE 1, %d,%d,1,0,0,0", 13 - 3 * i, i);
        expect_moved(rig, line);
        assert_true(device->site->bvh == first);
        assert_ptr_equal(device->site->station[1].sight, other);
        assert_ptr_equal(device->site->scene, rig->site->scene);
        assert_non_null(device->site->station[0].sight);
    }
    rig_close(rig);
}

static void what_nobody_uses_is_freed_once(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT, MAPS};
    struct rig *rig = rig_idle(NULL, sets, 4);
    struct device_moves *moves = &rig->device->moves;
    struct device_work late = {0}; /* a tick that was given up, and is still computed */
    assert_int_equal(device_claim(rig->device, &late), 0);
    rig->next++;
    for (int i = 1; i <= 60; i++) {
        char line[64];
        snprintf(line, sizeof line, "SITE:POSE %d, %g,0.5,0,%d,0,0", 1 + i % 2, 0.01 * i, i);
        expect_moved(rig, line);
        assert_true(rig_claim(rig));
        const struct native_event *event = rig_event(rig, NATIVE_EV_SITE);
        assert_true(event != NULL && event->a == (uint64_t)(1 + i % 2) && rig->work.describe);
        uint32_t held = 0;
        for (const struct device_version *v = moves->old; v != NULL; v = v->next)
            held++;
        assert_true(held <= 2); /* the late tick's, and that of the tick before */
        assert_true(rig->site->world->n_users <= 4);
    }
    assert_ptr_equal(device_site_of(late.version), rig->site);
    device_done(&late);
    rig_close(rig);
}

static void who_asks_holds_the_site_of_now(void **state)
{
    (void)state;
    static const char *const sets[] = {TRIPOD, "stations[1].name=far"};
    struct rig *rig = rig_idle(NULL, sets, 3);
    struct device_version *version;
    struct device_station at;
    const struct site *site = device_hold_site(rig->device, &version);
    device_get_station(rig->device, 0, &at);
    /* The floor is at -2: the top is 1.8 m above it, and a foot sqrt(2.5^2 - 1.8^2) from the plumb line. */
    assert_true(at.served && at.has_tripod && at.leg_m == 2.5 && fabs(at.height_m - 1.8) < 1e-9);
    assert_true(fabs(at.foot_radius_m - sqrt(2.5 * 2.5 - 1.8 * 1.8)) < 1e-9);
    expect_moved(rig, "SITE:POSE 1, 0,0,0.5,90,0,0");
    expect_moved(rig, "SITE:POSE 1, 0,0,0.4,90,0,0");
    assert_true(site->station[0].at.position_m[2] == 0.0); /* it is as it was */
    device_give_back(version);
    device_get_station(rig->device, 0, &at);
    assert_true(at.place.position_m[2] == 0.4 && at.place.heading_deg == 90.0 && fabs(at.height_m - 2.2) < 1e-9);
    device_get_station(rig->device, 1, &at);
    assert_true(!at.has_tripod && strcmp(at.name, "far") == 0 && rig->site->n_stations == 2);
    assert_true(at.served && at.place.position_m[0] == 0.5);
    /* The asker holds nothing afterwards. */
    expect_moved(rig, "SITE:POSE 1, 0,0,0.3,90,0,0");
    assert_true(rig_claim(rig));
    expect_moved(rig, "SITE:POSE 1, 0,0,0.2,90,0,0");
    assert_true(rig_claim(rig));
    const struct device_version *old = rig->device->moves.old;
    assert_true(old == NULL || old->next == NULL); /* that of the tick before at most */
    rig_close(rig);
}

/* Only the last scan's site can be held. A held site stays as it is. */
static void who_asks_holds_the_site_of_a_scan(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT};
    struct device_version *held;
    struct rig *rig = rig_idle(NULL, sets, 2);
    struct bytes b = scan(rig);
    const uint32_t number = rig->device->scan.number;
    assert_null(device_hold_scan(rig->device, number + 1, &held));
    assert_true(held == NULL);
    const struct site *site = device_hold_scan(rig->device, number, &held);
    assert_true(site != NULL && site->station[0].at.position_m[2] == 0.0);
    assert_non_null(held);
    rig_go_to(rig, rig->next + 100);
    expect_moved(rig, "SITE:POSE 1, 0,0,0.5,0,0,0");
    expect_moved(rig, "SITE:POSE 1, 0,0,0.25,0,0,0");
    assert_true(site->station[0].at.position_m[2] == 0.0);
    device_give_back(held);
    free(b.at);
    rig_close(rig);
}

/* ---- failures */

static void a_move_that_fails_changes_nothing(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT, TRIPOD};
    struct rig *rig = rig_idle(NULL, sets, 4);
    const struct site *was = rig->device->site;
    expect_refused(rig, "SITE:POSE 1, 0,0,-1.9,0,0,0", CMD_E_SETTINGS,
                   "SITE:POSE: stations[0] (station-1): tripod.head_above_m: 0.2 m, but the head is");
    assert_ptr_equal(rig->device->site, was);
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", rig->next), "0,0,0,0,0,0");
    assert_string_equal(rig_tell(rig, "SYST:CONT?", rig->next), "0"); /* a refused command takes no control */
    assert_true(rig_claim(rig));
    const struct native_event *last = NULL;
    for (uint32_t i = 0; i < rig->work.n_events; i++)
        if (rig->work.event[i].code == NATIVE_EV_CONTROL) last = &rig->work.event[i];
    assert_true(last != NULL && last->a == 0 && last->b == 0 && last->c == 0); /* nobody has it */
    assert_string_equal(last->text, "released");
    assert_string_equal(rig_tell(rig, "SYST:ERR:COUN?", rig->next), "1");
    assert_string_equal(rig_tell(rig, "SCAN:STARt", rig->next), "OK");
    expect_refused(rig, "SITE:POSE 1, 0,0,0.5,0,0,0", CMD_E_SETTINGS, "state spin-up");
    rig_close(rig);
}

static void nothing_starts_while_a_station_is_moved(void **state)
{
    (void)state;
    struct command_result result;
    struct rig *rig = rig_idle(NULL, NULL, 0);
    device_command(rig->device, 1, "SITE:POSE 2, 1,0,0,0,0,0", rig->next, &result);
    assert_int_equal(result.effect, COMMAND_MOVE);
    expect_refused(rig, "SCAN:STARt", CMD_E_SETTINGS, "station 2 is being moved");
    expect_refused(rig, "SITE:POSE 1, 1,0,0,0,0,0", CMD_E_SETTINGS, "station 2 is being moved");
    assert_string_equal(rig_tell(rig, "HEAD:STATe?", rig->next), "idle");
    assert_string_equal(rig_tell(rig, "SITE:POSE? 2", rig->next), "0.5,0,0,0,0,0");
    device_plan_move(rig->device);
    device_finish_move(rig->device, rig->next, &result);
    assert_string_equal(result.reply, "OK");
    assert_string_equal(rig_tell(rig, "SCAN:STARt", rig->next), "OK");
    rig_close(rig);
}

/* ACTIONS.md: a reboot moves no station, and a head that boots takes no place, also where its planning began before. */
static void a_reboot_moves_no_station(void **state)
{
    (void)state;
    struct command_result result;
    struct rig *rig = rig_idle(NULL, NULL, 0);
    expect_moved(rig, "SITE:POSE 1,2,0,0,0,0,0");
    device_command(rig->device, 1, "SITE:POSE 1,3,0,0,0,0,0", rig->next, &result);
    device_plan_move(rig->device);
    assert_string_equal(rig_tell(rig, "HEAD:REBOOT", rig->next), "OK");
    rig_go_to(rig, rig->next + 100);
    device_finish_move(rig->device, rig->next, &result);
    assert_non_null(strstr(result.reply, "SITE:POSE: the head is not idle any more"));
    expect_refused(rig, "SITE:POSE 1, DEF", CMD_E_SETTINGS, "SITE:POSE is not possible in state boot");
    rig_go_to(rig, rig->next + 300);
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", rig->next), "2,0,0,0,0,0");
    assert_string_not_equal(rig_tell(rig, "SITE:POSE? 1, DEF", rig->next), "2,0,0,0,0,0");
    rig_close(rig);
}

static void the_end_of_the_run_ends_planning(void **state)
{
    (void)state;
    struct command_result result;
    struct rig *rig = rig_idle(NULL, NULL, 0);
    device_command(rig->device, 1, "SITE:POSE 2, 1,0,0,0,0,0", rig->next, &result);
    device_end(rig->device);
    device_plan_move(rig->device);
    device_finish_move(rig->device, rig->next, &result);
    assert_int_equal(strncmp(result.reply, "ERR -221", 8), 0);
    rig_close(rig);
}

static void a_platforms_stations_stay(void **state)
{
    (void)state;
    static const char *const live[] = {"platform.kind=live", "platform.reach_m=2"};
    struct rig *rig = rig_open(NULL, live, 2);
    rig_go_to(rig, 300);
    expect_refused(rig, "SITE:POSE 1, 0,0,0.5,0,0,0", CMD_E_SETTINGS, "live platform");
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", rig->next), "0,0,0,0,0,0");
    rig_close(rig);
}

/* ---- with settings that are planned, too (HEAD:RANGe) */

static void settings_hold_at_the_new_place(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT}, *const at[] = {SHORT, "stations[0].position_m=[1.25, -2.5, 0.75]"};
    struct rig *moved = rig_idle(NULL, sets, 2), *there = rig_idle(NULL, at, 3);
    rig_tell(moved, "HEAD:RANGe:MAX 4", moved->next);
    struct bytes before = scan(moved); /* from the first place, so that the variant is there */
    free(before.at);
    rig_go_to(moved, moved->next + 100);
    expect_moved(moved, "SITE:POSE 1, 1.25,-2.5,0.75,0,0,0");
    rig_go_to(moved, moved->next + 1100); /* repeated descriptors, between scans */
    rig_tell(there, "HEAD:RANGe:MAX 4", there->next);
    before = scan(there);
    free(before.at);
    rig_go_to(there, there->next + 1200);
    struct bytes a = scan(moved), b = scan(there);
    expect_same(&a, &b); /* each is the second scan of its head */
    free(a.at);
    free(b.at);
    rig_close(moved);
    rig_close(there);
}

/* ---- journal */

static void a_replayed_journal_moves_at_the_same_tick(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT};
    struct rig *rig = rig_idle(&(struct device_options){.journal = journal_path}, sets, 2);
    expect_moved(rig, "SITE:POSE 1, 1.25,-2.5,0.75,33.5,4,-3");
    expect_refused(rig, "SITE:POSE 1, 1e9,1e9,x,0,0,0", CMD_E_DATA_TYPE, "'x'");
    rig_go_to(rig, 310);
    struct bytes a = scan(rig);
    rig_close(rig);
    rig = rig_open(&(struct device_options){.replay = journal_path}, sets, 2);
    rig_go_to(rig, 300);
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", 300), "0,0,0,0,0,0");
    assert_true(rig_claim(rig) && rig_event(rig, NATIVE_EV_SITE) != NULL);
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", 300), "1.25,-2.5,0.75,33.5,4,-3");
    struct bytes b = take_scan(rig);
    expect_same(&a, &b);
    free(a.at);
    free(b.at);
    rig_close(rig);
}

/* In real time all moves of a journal are planned before time begins, in order, each from the one before it. A refused
 * move is not among them, nor is a move to where the station is already. */
static void a_journals_moves_are_planned_ahead(void **state)
{
    (void)state;
    static const char *const sets[] = {SHORT};
    static const double z_m[] = {0.25, 0.5, 0.75};
    struct rig *rig = rig_idle(&(struct device_options){.journal = journal_path}, sets, 2);
    expect_moved(rig, "SITE:POSE 1, 0,0,0.25,0,0,0");
    rig_go_to(rig, 310);
    expect_moved(rig, "SITE:POSE 2, 0,0,0.5,0,0,0");
    rig_go_to(rig, 320);
    expect_refused(rig, "SITE:POSE 1, 1e9,1e9,x,0,0,0", CMD_E_DATA_TYPE, "'x'");
    expect_moved(rig, "SITE:POSE 1, 0,0,0.75,0,0,0");
    rig_go_to(rig, 330);
    rig_close(rig);
    rig = rig_open(&(struct device_options){.replay = journal_path}, sets, 2);
    const struct device_moves *moves = &rig->device->moves;
    for (int i = 0; i < 3; i++) {
        const struct device_version *next = moves->ahead;
        struct site_place first, second;
        int n = 0;
        for (const struct device_version *v = next; v != NULL; v = v->next)
            n++;
        assert_int_equal(n, 3 - i);
        site_get_place(next->site, 0, &first);
        site_get_place(next->site, 1, &second);
        assert_true(first.position_m[2] == z_m[i == 2 ? 2 : 0] && second.position_m[2] == (i > 0 ? z_m[1] : 0.0));
        rig_go_to(rig, 301 + 10 * (uint64_t)i);
        assert_ptr_equal(rig->device->site, next->site);
    }
    assert_null(moves->ahead);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_has_the_bytes_of_a_configuration_with_that_place),
        cmocka_unit_test(what_is_read_can_be_sent_back),
        cmocka_unit_test(the_bvh_and_the_maps_of_others_stay),
        cmocka_unit_test(what_nobody_uses_is_freed_once),
        cmocka_unit_test(who_asks_holds_the_site_of_now),
        cmocka_unit_test(who_asks_holds_the_site_of_a_scan),
        cmocka_unit_test(a_move_that_fails_changes_nothing),
        cmocka_unit_test(nothing_starts_while_a_station_is_moved),
        cmocka_unit_test(a_reboot_moves_no_station),
        cmocka_unit_test(the_end_of_the_run_ends_planning),
        cmocka_unit_test(a_platforms_stations_stay),
        cmocka_unit_test(settings_hold_at_the_new_place),
        cmocka_unit_test(a_replayed_journal_moves_at_the_same_tick),
        cmocka_unit_test(a_journals_moves_are_planned_ahead),
    };
    return cmocka_run_group_tests_name("moves", tests, make_folder, remove_folder);
}
