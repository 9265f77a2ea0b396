/* Ticks that the head could not compute in time: what was in them is said again. */
#include "tests/unit/device_rig.h"

static void a_lost_tick_says_its_events_again(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    assert_true(rig->work.describe && rig->work.describe_flags == 0);
    struct device_work lost = rig->work;
    struct command_result result;
    uint64_t n_cast = lost.n_cast;
    assert_true(n_cast > 0);
    device_command(rig->device, 1, "nonsense", rig->next, &result); /* a later event, which waits */
    device_lost(rig->device, &lost);
    assert_true(rig_claim(rig));
    assert_true(rig->work.describe && rig->work.describe_flags == 0);
    const struct native_event *again = rig_event(rig, NATIVE_EV_SCAN_START);
    assert_true(again != NULL && again->a == 1 && again->b == (uint64_t)lost.scan_t0_ns);
    assert_non_null(rig_event(rig, NATIVE_EV_STATE));
    assert_true(rig_event(rig, NATIVE_EV_ERROR) > again); /* they stay in order */
    rig_tell(rig, "SYST:ERR?", rig->next);
    const struct native_event *overrun = rig_event(rig, NATIVE_EV_OVERRUN);
    assert_true(overrun != NULL && overrun->b == n_cast && overrun->c == 1);
    assert_true(rig->work.pulse0 == lost.pulse_end); /* the pulses themselves are gone */
    assert_non_null(strstr(rig_tell(rig, "SYST:ERR?", rig->next), "103,"));
    const struct native_event *end = rig_wait(rig, NATIVE_EV_SCAN_END, 600);
    assert_true(end->b == 150000 && end->c == atomic_load(&device_counters(rig->device)->cast));
    assert_true(atomic_load(&device_counters(rig->device)->lost_pulses) == n_cast);
    rig_close(rig);
}

/* Two ticks are lost, one after the other, and with the second one the event that speaks of the first. */
static void a_lost_overrun_is_said_with_the_next(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, NULL, 0);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    assert_true(rig_claim(rig));
    struct device_work lost = rig->work;
    const uint64_t first = lost.cast0;
    uint64_t n_cast = lost.n_cast;
    device_lost(rig->device, &lost);
    for (uint64_t ticks = 1; ticks <= 3; ticks++) {
        assert_true(rig_claim(rig));
        const struct native_event *overrun = rig_event(rig, NATIVE_EV_OVERRUN);
        assert_non_null(overrun);
        assert_true(overrun->a == first && overrun->b == n_cast && overrun->c == ticks);
        lost = rig->work;
        n_cast += lost.n_cast;
        device_lost(rig->device, &lost);
    }
    rig_close(rig);
}

/* North at 900 m/s: after some 2 km the head is on another stretch of its path, which has an anchor of its own. Returns
 * the rig with the tick claimed in which the anchor changes. */
static struct rig *open_at_next_stretch(const char *path)
{
    char set[128];
    snprintf(set, sizeof set, "platform.waypoints=%s", path);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("x_m,y_m,z_m,speed_m_s\n0,0,0,900\n0,2500,0,900\n", f);
    assert_int_equal(fclose(f), 0);
    const char *const sets[] = {"platform.kind=trajectory", set, "stations[1].name=b", "head.frames=0",
                                "output.layout=geo"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 5);
    const size_t n = rig->site->n_stretches;
    assert_true(n > 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    const int64_t until_ns = rig->site->stretch[0].until_ns;
    while (schedule_time_ns(&rig->work.segment, rig->work.pulse_end - 1) < until_ns)
        assert_true(rig_claim(rig) && rig->work.scanning);
    assert_int_equal(rig->work.stretch, 0); /* it begins on the first one */
    assert_false(rig->work.describe);
    return rig;
}

/* An anchor is lost with its tick: the tick after it has it, as a repetition. */
static void expect_anchor(struct rig *rig, double centre_y_m)
{
    assert_true(rig_claim(rig));
    assert_true(rig->work.describe && rig->work.describe_flags == NATIVE_REPEAT && rig->work.stretch == 1);
    assert_true(rig->work.anchor.anchor[1] > centre_y_m);
}

static void a_lost_anchor_comes_again(void **state)
{
    (void)state;
    char path[96];
    snprintf(path, sizeof path, "%s/far.csv", folder);
    struct rig *rig = open_at_next_stretch(path);
    struct device_work lost = rig->work;
    device_lost(rig->device, &lost);
    expect_anchor(rig, 1500);
    lost = rig->work;
    device_lost(rig->device, &lost); /* this one, too */
    expect_anchor(rig, 1500);
    assert_true(rig_claim(rig));
    assert_false(rig->work.describe); /* once is enough */
    rig_close(rig);
    rig = open_at_next_stretch(path);
    lost = rig->work;
    for (int i = 0; i < 2; i++) { /* it is known only ticks later, and nothing else was lost */
        assert_true(rig_claim(rig));
        assert_false(rig->work.describe);
    }
    device_lost(rig->device, &lost);
    expect_anchor(rig, 1500);
    rig_close(rig);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lost_tick_says_its_events_again),
        cmocka_unit_test(a_lost_overrun_is_said_with_the_next),
        cmocka_unit_test(a_lost_anchor_comes_again),
    };
    return cmocka_run_group_tests_name("device lost", tests, make_folder, remove_folder);
}
