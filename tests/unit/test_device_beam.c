/* SPDX-License-Identifier: MIT */
/* Faults that change the measurements, tick by tick: where they begin and end. No pulse is lost by them. */
#include "tests/unit/device_rig.h"

#define LEN(array) ((int)(sizeof(array) / sizeof((array)[0])))

enum { MAX_NOTES = 16 };

static struct fault_note notes[MAX_NOTES];
static uint32_t n_notes;

static void hear(void *ctx, const struct fault_note *note)
{
    (void)ctx;
    assert_true(n_notes < MAX_NOTES);
    notes[n_notes++] = *note;
}

/* Opens a scan that begins, with these settings and faults. */
static struct rig *open_scan(const char *const *sets, int n_sets, const char *const *faults, int n_faults)
{
    struct rig *rig = rig_open(NULL, sets, n_sets);
    n_notes = 0;
    fault_board_listen(device_faults(rig->device), hear, NULL);
    rig_go_to(rig, 300);
    for (int i = 0; i < n_faults; i++) {
        char line[160];
        snprintf(line, sizeof line, "FAUL:ADD %s", faults[i]);
        rig_tell(rig, line, 299);
    }
    rig_tell(rig, "SCAN:STAR", 299);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    return rig;
}

static void assert_note(uint32_t i, uint32_t fault, int ended, uint64_t pulse)
{
    assert_true(i < n_notes);
    assert_int_equal(notes[i].fault, fault);
    assert_int_equal(notes[i].ended, ended);
    assert_true(notes[i].has_pulse);
    assert_int_equal(notes[i].pulse, pulse);
    assert_true(notes[i].byte == -1 && notes[i].link == 0 && notes[i].session == 0 && notes[i].number == 0);
}

/* At the head's highest rate there are 2000 pulses a tick. If a fault begins or ends in a tick, the tick ends there and
 * leaves up to 2000 pulses. Each later tick has room for an eighth more, so eight ticks later all are caught up. */
static void a_tick_ends_where_a_fault_does(void **state)
{
    (void)state;
    const char *const sets[] = {"head.prr_hz=2000000", "head.frames=1"};
    const char *const faults[] = {"{kind: laser_off, from_pulse: 100001, until_pulse: 100001}",
                                  "{kind: pan_slip, from_pulse: 100777, until_pulse: 200002}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    uint64_t next = rig->work.pulse_end, begin_tick = rig->work.tick, cut_tick = 0;
    for (int is_over = 0; !is_over && rig_claim(rig); is_over = rig_event(rig, NATIVE_EV_SCAN_END) != NULL) {
        const struct device_work *work = &rig->work;
        const uint64_t due = (work->tick - begin_tick + 1) * 2000;
        assert_true(work->pulse0 == next);
        next = work->pulse_end;
        const uint64_t last = next - 1;
        const int is_dark = work->pulse0 == 100001 && last == 100001, slips = work->pulse0 >= 100777 && last <= 200002;
        assert_int_equal(work->disturbance.on, is_dark || slips);
        if (is_dark) assert_true(work->disturbance.cast.dark);
        if (slips) assert_true(work->disturbance.cast.slip_turn == 1.0 / 360.0);
        if (next % 16 != 0 && cut_tick == 0) cut_tick = work->tick;
        if (work->tick > cut_tick + 24 && next < 150000) assert_true(next + 32 > due);
        rig_fill(rig);
    }
    assert_int_equal(next, 1000000); /* 90 deg at 180 deg/s, and whole lines */
    assert_int_equal(n_notes, 4);
    assert_note(0, 1, 0, 100001);
    assert_note(1, 1, 1, 100002);
    assert_note(2, 2, 0, 100777);
    assert_note(3, 2, 1, 200003);
    rig_close(rig);
}

/* The lines of the segment follow the mirror; the descriptor has the settings. */
static void settings_change_while_the_mirror_is_slow(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"};
    const char *const faults[] = {"{kind: mirror_slow, factor: 0.25, from_pulse: 30001, until_pulse: 90000}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    rig_go_to(rig, rig->next + 150);
    assert_int_equal(rig->work.segment.spec.lines_uhz, 25000000);
    rig_tell(rig, "HEAD:LINES 200", rig->next - 1);
    rig_claim(rig);
    assert_true(rig->work.describe);
    assert_int_equal(rig->work.descriptor.lines_uhz, 200000000);
    assert_int_equal(rig->work.segment.spec.lines_uhz, 50000000);
    rig_go_to(rig, rig->next + 200);
    assert_int_equal(rig->work.segment.spec.lines_uhz, 200000000);
    assert_int_equal(rig->work.segment.k0, 90001);
    assert_int_equal(n_notes, 2);
    assert_string_equal(notes[0].text, "scan 1, 25.000000 lines per second");
    rig_close(rig);
}

/* A fault ends with the scan, or when it is cleared, and begins anew with the next one. */
static void faults_end_with_their_scan(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"}, *const faults[] = {"{kind: mirror_stuck, from_pulse: 999}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    rig_go_to(rig, rig->next + 100);
    assert_true(rig->work.disturbance.stuck);
    rig_tell(rig, "SCAN:STOP", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_END, 10);
    assert_note(0, 1, 0, 999);
    assert_note(1, 1, 1, rig->work.pulse_end);
    assert_int_equal(notes[1].t_ns, (int64_t)rig->next * 1000000);  /* the end of the last tick */
    assert_string_equal(notes[0].text, "scan 1, at 39.920000 deg"); /* 999 of 3000 pulses of 240 deg from -40 on */
    assert_string_equal(notes[1].text, "scan 1");
    rig_go_to(rig, rig->next + 100);
    rig_tell(rig, "HEAD:LINES 200", rig->next - 1);
    rig_tell(rig, "SCAN:STAR", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    rig_go_to(rig, rig->next + 50);
    assert_true(rig->work.disturbance.stuck);
    const uint64_t cleared = rig->work.pulse_end;
    rig_tell(rig, "FAUL:CLE ALL", rig->next - 1);
    rig_claim(rig);
    assert_false(rig->work.disturbance.on);
    assert_int_equal(rig->work.pulse0, cleared);
    assert_int_equal(n_notes, 4);
    assert_note(2, 1, 0, 999);
    assert_string_equal(notes[2].text, "scan 2, at 119.840000 deg"); /* 999 of 1500 pulses */
    assert_note(3, 1, 1, cleared);
    rig_close(rig);
}

/* Where the mirror stood in the scan before means nothing to the next one, also at its first pulse. */
static void the_mirror_stands_anew_in_each_scan(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"}, *const faults[] = {"{kind: mirror_stuck, from_pulse: 999}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    rig_go_to(rig, rig->next + 20);
    rig_tell(rig, "SCAN:STOP", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_END, 10);
    rig_go_to(rig, rig->next + 100);
    rig_tell(rig, "FAUL:ADD {kind: mirror_stuck}", rig->next - 1);
    rig_tell(rig, "SCAN:STAR", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    rig_go_to(rig, rig->next + 20);
    assert_true(n_notes >= 3);
    assert_string_equal(notes[0].text, "scan 1, at 39.920000 deg");
    assert_string_equal(notes[2].text, "scan 2, at -40.000000 deg");
    rig_close(rig);
}

/* A stopped mirror does not wobble; once it turns again it does. */
static void what_stands_does_not_wobble(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"};
    const char *const faults[] = {"{kind: mirror_stuck, from_pulse: 6000, until_pulse: 12000}",
                                  "{kind: mirror_wobble, from_pulse: 3000, deg: 0.1, hz: 10}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    int n_stuck = 0, n_wobbling = 0;
    for (int i = 0; i < 60 && rig_claim(rig); i++) {
        const struct device_work *work = &rig->work;
        const int stuck = work->pulse0 >= 6000 && work->pulse_end <= 12001;
        const int wobbles = !stuck && work->pulse0 >= 3000;
        assert_int_equal(work->disturbance.on, stuck || wobbles);
        if (!work->disturbance.on) continue;
        assert_int_equal(work->disturbance.stuck, stuck);
        assert_int_equal(work->disturbance.cast.n_wobbles, wobbles);
        n_stuck += stuck;
        n_wobbling += wobbles;
    }
    assert_true(n_stuck > 10 && n_wobbling > 10);
    rig_close(rig);
}

/* The time of a command's fault counts from the command on: from the first pulse that fires then. */
static void an_added_fault_counts_from_its_command(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"};
    struct rig *rig = open_scan(sets, LEN(sets), NULL, 0);
    const int64_t t0_ns = rig->work.scan_t0_ns;
    rig_go_to(rig, rig->next + 50);
    const int64_t added_ns = (int64_t)rig->next * 1000000 - t0_ns;
    rig_tell(rig, "FAUL:ADD {kind: laser_off, from_s: 0.0100001, until_s: 0.02}", rig->next - 1);
    rig_go_to(rig, rig->next + 50);
    /* 300 kHz: pulse k fires at k * 10 / 3 us. */
    const uint64_t begin = ((uint64_t)(added_ns + 10000100) * 3 + 9999) / 10000;
    const uint64_t end = ((uint64_t)(added_ns + 20000000) * 3 + 9999) / 10000;
    assert_int_equal(n_notes, 2);
    assert_note(0, 1, 0, begin);
    assert_note(1, 1, 1, end);
    rig_close(rig);
}

/* The list of faults changes while one of them strikes. The striking fault goes on, and the mirror stands where it
 * stood. */
static void another_fault_leaves_it_as_it_is(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"}, *const faults[] = {"{kind: mirror_stuck, from_pulse: 999}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    rig_go_to(rig, rig->next + 20);
    const double turn = rig->work.disturbance.stuck_turn;
    rig_tell(rig, "FAUL:ADD {kind: laser_off}", rig->next - 1);
    rig_go_to(rig, rig->next + 20);
    assert_true(rig->work.disturbance.cast.dark && rig->work.disturbance.stuck &&
                rig->work.disturbance.stuck_turn == turn);
    assert_int_equal(n_notes, 2);
    assert_note(0, 1, 0, 999);
    assert_int_equal(notes[1].fault, 2);
    rig_tell(rig, "FAUL:CLE 2", rig->next - 1);
    rig_go_to(rig, rig->next + 20);
    assert_true(!rig->work.disturbance.cast.dark && rig->work.disturbance.stuck_turn == turn);
    assert_int_equal(n_notes, 3);
    assert_int_equal(notes[2].fault, 2);
    rig_close(rig);
}

/* The mirror is limited to lines of 100 s, and to the profile's lines per second. */
static void the_mirror_has_limits(void **state)
{
    (void)state;
    const char *const slow[] = {"head.lines_hz=1", "head.frames=0"}, *const fast[] = {"head.lines_hz=1000",
                                                                                      "head.frames=0"};
    const char *const slowest[] = {"{kind: mirror_slow, factor: 0.01}"}, *const fastest[] = {
                                                                             "{kind: mirror_slow, factor: 2}"};
    struct rig *rig = open_scan(slow, LEN(slow), slowest, 1);
    for (int i = 0; i < 200; i++) {
        rig_fill(rig);
        rig_claim(rig);
    }
    assert_int_equal(rig->work.segment.spec.lines_uhz, 10000);
    rig_close(rig);
    rig = open_scan(fast, LEN(fast), fastest, 1);
    rig_tell(rig, "HEAD:LINES 2000", rig->next - 1);
    for (int i = 0; i < 50; i++) {
        rig_claim(rig);
        rig_fill(rig);
    }
    assert_int_equal(rig->work.segment.spec.lines_uhz, 2000000000);
    rig_close(rig);
}

/* Losses of soiled windows add up while they last. Other faults lose nothing. */
static void losses_of_the_window_add_up(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0", "signal.model=on"};
    const char *const faults[] = {"{kind: window_soiled, loss_db: 1.5}", "{kind: mirror_slow, factor: 0.5}",
                                  "{kind: window_soiled, loss_db: 0.25, from_pulse: 3000}"};
    struct rig *rig = open_scan(sets, LEN(sets), faults, LEN(faults));
    assert_true(device_window_loss_db(rig->device) == 1.5);
    rig_go_to(rig, rig->next + 20); /* 300 pulses a tick */
    assert_true(device_window_loss_db(rig->device) == 1.75);
    rig_tell(rig, "FAUL:CLE 1", rig->next - 1);
    rig_claim(rig);
    assert_true(device_window_loss_db(rig->device) == 0.25);
    rig_tell(rig, "SCAN:STOP", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_END, 100);
    assert_true(device_window_loss_db(rig->device) == 0.0);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tick_ends_where_a_fault_does),   cmocka_unit_test(settings_change_while_the_mirror_is_slow),
        cmocka_unit_test(faults_end_with_their_scan),       cmocka_unit_test(the_mirror_stands_anew_in_each_scan),
        cmocka_unit_test(what_stands_does_not_wobble),      cmocka_unit_test(an_added_fault_counts_from_its_command),
        cmocka_unit_test(another_fault_leaves_it_as_it_is), cmocka_unit_test(the_mirror_has_limits),
        cmocka_unit_test(losses_of_the_window_add_up),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
