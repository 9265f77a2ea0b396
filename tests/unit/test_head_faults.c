/* SPDX-License-Identifier: MIT */
/* Faults in the head: when they begin and end, and their notes (firmware_sim/device/head_faults.h). */
#include "firmware_sim/device/head_faults.h"

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>
#include <string.h>

enum { TICK_NS = 1000000, MAX_NOTES = 16 };

struct rig {
    struct fault_board *board;
    struct head_faults faults;
    struct fault_note note[MAX_NOTES];
    uint32_t n;
};

static void hear(void *ctx, const struct fault_note *note)
{
    struct rig *rig = ctx;
    assert_true(rig->n < MAX_NOTES);
    rig->note[rig->n++] = *note;
}

static void open_rig(struct rig *rig, const struct fault_list *list)
{
    struct sh_err err;
    memset(rig, 0, sizeof *rig);
    assert_int_equal(fault_board_create(list, NULL, NULL, &rig->board, &err), SH_OK);
    fault_board_listen(rig->board, hear, rig);
    head_faults_init(&rig->faults, rig->board, TICK_NS);
}

static int step(struct rig *rig, uint64_t kinds, int64_t tick, int64_t pulse0)
{
    const struct head_faults_tick at = {.t_ns = tick * TICK_NS,
                                        .has_pulses = pulse0 >= 0,
                                        .pulse0 = pulse0 >= 0 ? (uint64_t)pulse0 : 0,
                                        .n_pulses = 10};
    return head_faults_step(&rig->faults, kinds, &at);
}

static struct fault make(enum fault_kind kind, double from_s, double until_s)
{
    return (struct fault){
        .kind = kind, .probability = 1.0, .until_pulse = UINT64_MAX, .from_s = from_s, .until_s = until_s};
}

/* Windows may begin between ticks. Windows of clock faults are exact, and the others are of whole ticks. */
static void begins_and_ends_at_its_times(void **state)
{
    (void)state;
    const uint64_t kinds = HEAD_FAULTS_CLOCK | HEAD_FAULTS_BEAM;
    struct fault_list list = {.n = 2};
    list.fault[0] = make(FAULT_CLOCK_STOP, 0.0025, 0.0043);
    list.fault[1] = make(FAULT_LASER_OFF, 0.0025, 0.0043);
    for (int i = 0; i < 2; i++) {
        list.fault[i].for_ms = 12.5 + i;
        list.fault[i].n = 3 + (uint32_t)i;
    }
    struct rig rig;
    open_rig(&rig, &list);
    static const struct {
        int clock, laser;
    } active[8] = {{0, 0}, {0, 0}, {1, 0}, {1, 1}, {1, 1}, {0, 0}, {0, 0}, {0, 0}};
    for (int64_t tick = 0; tick < 8; tick++) {
        assert_int_equal(step(&rig, kinds, tick, -1), tick >= 2 && tick <= 5);
        assert_int_equal(head_faults_next(&rig.faults, FAULT_CLOCK_STOP, NULL) != NULL, active[tick].clock);
        assert_int_equal(head_faults_next(&rig.faults, FAULT_LASER_OFF, NULL) != NULL, active[tick].laser);
    }
    static const struct {
        uint32_t fault;
        int64_t t_ns;
        int ended;
    } want[] = {{1, 2500000, 0}, {2, 3000000, 0}, {1, 4300000, 1}, {2, 5000000, 1}};
    assert_int_equal(rig.n, 4);
    for (uint32_t i = 0; i < 4; i++) {
        assert_int_equal(rig.note[i].fault, want[i].fault);
        assert_int_equal(rig.note[i].t_ns, want[i].t_ns);
        assert_int_equal(rig.note[i].ended, want[i].ended);
        assert_false(rig.note[i].has_pulse);
        assert_true(rig.note[i].for_ms == 11.5 + want[i].fault && rig.note[i].byte == -1);
        if (!want[i].ended) assert_int_equal(rig.note[i].n, 2 + want[i].fault);
    }
    fault_board_free(rig.board);
}

/* The fault strikes pulses 15 to 34 of each scan, ten in a tick. The note names the first hit pulse. */
static void strikes_each_scan_at_its_pulses(void **state)
{
    (void)state;
    struct fault_list list = {.n = 1};
    list.fault[0] = make(FAULT_LASER_OFF, 0.0, 0.0);
    list.fault[0].from_pulse = 15;
    list.fault[0].until_pulse = 34;
    struct rig rig;
    open_rig(&rig, &list);
    static const int64_t pulse[] = {-1, 0, 10, 20, 30, 40, 50, -1, 0, 10, -1};
    static const int active[] = {0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 0};
    for (int64_t i = 0; i < 11; i++) {
        step(&rig, HEAD_FAULTS_BEAM, i, pulse[i]);
        assert_int_equal(head_faults_next(&rig.faults, FAULT_LASER_OFF, NULL) != NULL, active[i]);
    }
    assert_int_equal(rig.n, 4);
    assert_true(rig.note[0].has_pulse && rig.note[0].pulse == 15 && rig.note[0].t_ns == 2 * TICK_NS);
    assert_true(rig.note[1].ended && rig.note[1].pulse == 40);
    assert_true(rig.note[2].has_pulse && rig.note[2].pulse == 15 && rig.note[2].t_ns == 9 * TICK_NS);
    assert_true(rig.note[3].ended && !rig.note[3].has_pulse);
    fault_board_free(rig.board);
}

/* A change of the list ends the active faults that it takes out, and leaves the others as they are. */
static void follows_the_board(void **state)
{
    (void)state;
    const struct fault laser = make(FAULT_LASER_OFF, 0.001, 0.0), pan = make(FAULT_PAN_SLIP, 0.002, 0.0);
    const struct fault_list empty = {0};
    struct rig rig;
    struct sh_err err;
    uint32_t number;
    open_rig(&rig, &empty);
    assert_int_equal(step(&rig, HEAD_FAULTS_BEAM, 0, -1), 0);
    assert_int_equal(fault_board_add(rig.board, &laser, 1 * TICK_NS, &number, &err), SH_OK);
    for (int64_t tick = 1; tick < 4; tick++)
        step(&rig, HEAD_FAULTS_BEAM, tick, -1);
    assert_int_equal(rig.n, 1);
    assert_int_equal(rig.note[0].t_ns, 2 * TICK_NS);
    assert_int_equal(fault_board_add(rig.board, &pan, 4 * TICK_NS, &number, &err), SH_OK);
    step(&rig, HEAD_FAULTS_BEAM, 4, -1);
    assert_int_equal(rig.n, 1);
    assert_int_equal(fault_board_end(rig.board, 1, INT64_MIN), 1);
    assert_int_equal(step(&rig, HEAD_FAULTS_BEAM, 5, -1), 1);
    assert_int_equal(rig.n, 2);
    assert_true(rig.note[1].fault == 1 && rig.note[1].ended && rig.note[1].t_ns == 5 * TICK_NS);
    step(&rig, HEAD_FAULTS_BEAM, 6, -1);
    assert_int_equal(rig.n, 3);
    assert_true(rig.note[2].fault == 2 && !rig.note[2].ended && rig.note[2].t_ns == 6 * TICK_NS);
    fault_board_free(rig.board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(begins_and_ends_at_its_times),
        cmocka_unit_test(strikes_each_scan_at_its_pulses),
        cmocka_unit_test(follows_the_board),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
