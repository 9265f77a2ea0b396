/* SPDX-License-Identifier: MIT */
/* The PTP follower in a device: the clock that its servo makes, to the nanosecond, and its states beside those of
 * ptp4l. The expected clock is computed here in exact integers: with a Sync each second the gains 0.7 and 0.3 are 700
 * and 300 ppt for a nanosecond of offset, so nothing is rounded but the reading, which is a floor. */
#include "tests/unit/device_rig.h"

#include <inttypes.h>

__extension__ typedef __int128 i128;
#define SECOND_NS INT64_C(1000000000)
static const i128 PPT = 1000000000000;

/* A rig whose time of day at power-up is a whole second, and which has these faults from power-up on. */
static struct rig *follow(const char *const *more, int n_more, const char *const *faults, int n_faults)
{
    const char *sets[8] = {"time.epoch=2026-01-01T00:00:00Z", "time.ptp.follower=on"};
    for (int i = 0; i < n_more; i++)
        sets[2 + i] = more[i];
    struct rig *rig = rig_open(NULL, sets, 2 + n_more);
    for (int i = 0; i < n_faults; i++) {
        char line[200];
        snprintf(line, sizeof line, "FAULt:ADD %s", faults[i]);
        rig_tell(rig, line, 0);
    }
    return rig;
}

struct answer {
    char port[16], master[24];
    int servo, class, accuracy, utc;
    int64_t offset_ns, delay_ns;
};

static struct answer ask(struct rig *rig, uint64_t tick)
{
    struct answer a = {.servo = -1};
    const char *text = rig_tell(rig, "TIME:PTP?", tick);
    if (sscanf(text, "%15[A-Z],s%d,%" SCNd64 ",%" SCNd64 ",%23[0-9a-f.],%d,0x%x,%d", a.port, &a.servo, &a.offset_ns,
               &a.delay_ns, a.master, &a.class, (unsigned *)&a.accuracy, &a.utc) != 8)
        fail_msg("%s", text);
    return a;
}

/* The head's time of day since its epoch, ns. The time is within the first minute. */
static int64_t shown_ns(struct rig *rig, uint64_t tick)
{
    const char *text = rig_tell(rig, "TIME:UTC?", tick);
    int64_t s, ns;
    if (sscanf(text, "2026-01-01T00:00:%2" SCNd64 ".%9" SCNd64 "Z", &s, &ns) != 2) fail_msg("%s", text);
    return s * SECOND_NS + ns;
}

/* ---- the clock beside an exact one */

/* A fault of the test's scenario adds a gain, or moves the master. */
static const struct {
    int64_t from_ns, until_ns, ppt, master_ns;
} DONE[] = {{9300000001, 18200000007, 2000000, 0}, {24999999999, 27000000001, 0, -5000}};
static const char *const FAULTS[] = {"{kind: ptp_lost, from_s: 9.300000001, until_s: 18.200000007, ppm: 2}",
                                     "{kind: ptp_step, from_s: 24.999999999, until_s: 27.000000001, ns: -5000}"};

struct model {
    int64_t t_ns, servo_ppt, estimate_ppt, first_ns;
    i128 error; /* of the clock, 1e-12 ns */
    int samples;
};

static int64_t floor_ns(i128 error)
{
    return (int64_t)((error + PPT * SECOND_NS) / PPT - SECOND_NS);
}

static void advance(struct model *m, int64_t t_ns)
{
    m->error += (i128)(t_ns - m->t_ns) * (12345678 + m->servo_ppt);
    for (int i = 0; i < 2; i++) {
        const int64_t from_ns = m->t_ns > DONE[i].from_ns ? m->t_ns : DONE[i].from_ns,
                      until_ns = t_ns < DONE[i].until_ns ? t_ns : DONE[i].until_ns;
        if (until_ns > from_ns) m->error += (i128)(until_ns - from_ns) * DONE[i].ppt;
    }
    m->t_ns = t_ns;
}

static int64_t master_at(int64_t t_ns)
{
    return t_ns >= DONE[1].from_ns && t_ns < DONE[1].until_ns ? DONE[1].master_ns : 0;
}

static void take(struct model *m, int64_t offset_ns)
{
    if (++m->samples == 1) {
        m->first_ns = offset_ns;
    } else if (m->samples == 2) { /* a second apart */
        m->servo_ppt = m->estimate_ppt = -1000 * (offset_ns - m->first_ns);
        m->error -= PPT * offset_ns; /* it is beyond 20 us */
    } else {
        m->estimate_ppt -= 300 * offset_ns;
        m->servo_ppt = m->estimate_ppt - 700 * offset_ns;
    }
}

/* The time that the clock shows, by the model of the last Sync before it; `at` has one for each second. */
static int64_t modelled_ns(const struct model *at, int64_t t_ns)
{
    struct model m = at[t_ns / SECOND_NS];
    advance(&m, t_ns);
    return t_ns + floor_ns(m.error);
}

/* An edge is the first nanosecond that shows its second. The step at 5 s sets the clock back to a whole second, which
 * begins there again. */
static int check_edge(const struct model *at, const struct native_event *pps)
{
    if (pps == NULL) return 0;
    const int64_t second_ns = (int64_t)(pps->a - UINT64_C(1767225600)) * SECOND_NS, t_ns = (int64_t)pps->b;
    assert_true(modelled_ns(at, t_ns) >= second_ns && (modelled_ns(at, t_ns - 1) < second_ns || t_ns == 5 * SECOND_NS));
    return 1;
}

/* The clock is 12.3 ppm fast and 50 us ahead. Sync comes from 4 s on, when the second Announce does. While the master
 * is lost, from 9.3 s to 18.2 s, the clock gains 2 ppm more than the servo knows. The port listens from 14 s on, and
 * the Announce messages at 20 and 22 s bring the master back. */
static void the_clock_is_as_computed(void **state)
{
    (void)state;
    enum { N_S = 32 };
    static const char *const sets[] = {"time.drift_ppm=12.345678", "time.offset_s=0.00005",
                                       "time.ptp.path_delay_ns=850"};
    struct rig *rig = follow(sets, 3, FAULTS, 2);
    struct model m[N_S] = {{.error = 50000 * PPT}};
    int n_syncs = 0, n_edges = 0;
    for (uint64_t s = 0; s < N_S; s++) {
        if (s > 0) m[s] = m[s - 1];
        advance(&m[s], (int64_t)s * SECOND_NS);
        assert_true(rig_claim(rig));
        const struct native_event pps =
            rig_event(rig, NATIVE_EV_PPS) != NULL ? *rig_event(rig, NATIVE_EV_PPS) : (struct native_event){.code = 0};
        if ((s >= 4 && s <= 9) || s >= 22) {
            const struct answer a = ask(rig, s * 1000);
            assert_int_equal(a.offset_ns, floor_ns(m[s].error) - master_at(m[s].t_ns));
            assert_int_equal(a.delay_ns, 850);
            take(&m[s], a.offset_ns);
            n_syncs++;
        }
        if (s > 1) n_edges += check_edge(m, pps.code != 0 ? &pps : NULL);
        while (rig->next < (s + 1) * 1000 && rig_claim(rig))
            n_edges += check_edge(m, rig_event(rig, NATIVE_EV_PPS));
        for (uint64_t k = 0; k < 1000; k += 37)
            assert_int_equal(shown_ns(rig, s * 1000 + k), modelled_ns(m, (int64_t)(s * 1000 + k) * 1000000));
    }
    assert_true(n_syncs == 16 && n_edges >= N_S - 2);
    rig_close(rig);
}

/* ---- states */

struct said {
    int64_t at_ns;
    uint32_t port, servo;
    const char *text;
};

static void expect_events(struct rig *rig, const struct said *want, int n_want, uint64_t until_tick, uint64_t master)
{
    int n = 0;
    while (rig->next < until_tick) {
        assert_true(rig_claim(rig));
        for (uint32_t i = 0; i < rig->work.n_events; i++) {
            const struct native_event *e = &rig->work.event[i];
            if (e->code != NATIVE_EV_PTP) continue;
            if (n == n_want) fail_msg("one more at %" PRIu64 ": %s", e->b, e->text);
            assert_string_equal(e->text, want[n].text);
            assert_int_equal(e->b, want[n].at_ns);
            assert_int_equal(e->a, want[n].port + 256 * want[n].servo);
            assert_true(e->c == 0 || e->c == UINT64_C(0x00b0aefffe000001) || e->c == master);
            assert_true(rig->work.tick == e->b / 1000000);
            n++;
        }
    }
    assert_int_equal(n, n_want);
}

/* The texts are those that ptp4l 3.1.1 wrote where its link went down and its master was ended, with the servo's states
 * that its lines of offsets have. Announce messages come at even seconds, so a master whose last one came at 30 s is
 * lost at 36 s. */
static void the_states_are_those_of_ptp4l(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.step_threshold_ns=4000"};
    static const char *const faults[] = {
        "{kind: ptp_faulty, from_s: 7.0001, until_s: 9.0002, ppm: 0}",
        "{kind: ptp_grandmaster, from_s: 17, until_s: 25, grandmaster: 0xec4670fffe0a1b2c, ns: 5000, clock_class: 7}",
        "{kind: ptp_lost, from_s: 31.5, until_s: 38, ppm: 0}", "{kind: ptp_no_sync, from_s: 39, until_s: 49, ppm: 0}"};
    static const struct said want[] = {
        {200000000, 4, 0, "INITIALIZING to LISTENING on INIT_COMPLETE"},
        {4000000000, 8, 0, "LISTENING to UNCALIBRATED on RS_SLAVE"},
        {5000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s0 to s2"},
        {7000100000, 2, 2, "SLAVE to FAULTY on FAULT_DETECTED"},
        {9000200000, 4, 2, "FAULTY to LISTENING on INIT_COMPLETE"},
        {12000000000, 8, 2, "LISTENING to UNCALIBRATED on RS_SLAVE"},
        {12000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED"},
        {20000000000, 8, 2, "SLAVE to UNCALIBRATED on RS_SLAVE"},
        {20000000000, 8, 0, "servo s2 to s0"},
        {22000000000, 8, 1, "servo s0 to s1"},
        {23000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
        {28000000000, 8, 2, "SLAVE to UNCALIBRATED on RS_SLAVE"},
        {28000000000, 8, 0, "servo s2 to s0"},
        {30000000000, 8, 1, "servo s0 to s1"},
        {31000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
        {36000000000, 4, 2, "SLAVE to LISTENING on ANNOUNCE_RECEIPT_TIMEOUT_EXPIRES"},
        {40000000000, 8, 2, "LISTENING to UNCALIBRATED on RS_SLAVE"},
        {49000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED"},
    };
    struct rig *rig = follow(sets, 1, faults, 4);
    expect_events(rig, want, (int)(sizeof want / sizeof want[0]), 24000 + 26001, UINT64_C(0xec4670fffe0a1b2c));
    const struct answer a = ask(rig, rig->next - 1);
    assert_true(strcmp(a.port, "SLAVE") == 0 && a.servo == 2 && a.class == 6 && a.accuracy == 0x21 && a.utc == 1);
    assert_string_equal(a.master, "00b0ae.fffe.000001"); /* as pmc writes identities */
    rig_close(rig);
}

/* A head that comes up with a faulty port says so at once, whether the fault began before power went or meanwhile. */
static void a_faulty_port_outlasts_power(void **state)
{
    (void)state;
    static const char *const faults[] = {"{kind: power_cycle, from_s: 8, until_s: 8.1, for_ms: 2000}",
                                         "{kind: power_cycle, from_s: 20.5, until_s: 20.6, for_ms: 2000}",
                                         "{kind: ptp_faulty, from_s: 7.0001, until_s: 15.0002, ppm: 0}",
                                         "{kind: ptp_faulty, from_s: 21.1, until_s: 30.0003, ppm: 0}"};
    static const struct said want[] = {
        {7000100000, 2, 2, "SLAVE to FAULTY on FAULT_DETECTED"},
        {10200000000, 4, 0, "INITIALIZING to LISTENING on INIT_COMPLETE"},
        {10200000000, 2, 0, "LISTENING to FAULTY on FAULT_DETECTED"},
        {15000200000, 4, 0, "FAULTY to LISTENING on INIT_COMPLETE"},
        {18000000000, 8, 0, "LISTENING to UNCALIBRATED on RS_SLAVE"},
        {19000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s0 to s2"},
        {22700000000, 4, 0, "INITIALIZING to LISTENING on INIT_COMPLETE"},
        {22700000000, 2, 0, "LISTENING to FAULTY on FAULT_DETECTED"},
        {30000300000, 4, 0, "FAULTY to LISTENING on INIT_COMPLETE"},
    };
    struct rig *rig = follow(NULL, 0, faults, 4);
    rig_go_to(rig, 6000);
    expect_events(rig, want, (int)(sizeof want / sizeof want[0]), 31000, 0);
    rig_close(rig);
}

/* The other grandmaster's time is shown, exactly, and its identity and class are reported. */
static void another_grandmaster_has_another_time(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.step_threshold_ns=1000000", "time.ptp.utc_valid=off"};
    static const char *const faults[] = {
        "{kind: ptp_grandmaster, from_s: 9, grandmaster: 0xffffffffffffffff, ns: 3000000000, clock_class: 248}"};
    struct rig *rig = follow(sets, 2, faults, 1);
    rig_go_to(rig, 16000);
    const struct answer a = ask(rig, 15500);
    assert_string_equal(a.master, "ffffff.ffff.ffffff");
    assert_true(a.class == 248 && a.utc == 0 && a.servo == 2 && a.offset_ns == 0);
    assert_int_equal(shown_ns(rig, 15500), INT64_C(18500000000));
    assert_int_equal(ask(rig, 12000).offset_ns, -3000000000); /* the Sync at 12 s comes after the second Announce */
    rig_close(rig);
}

/* A grandmaster that loses its reference keeps its identity: the class changes with the next Announce, the time with
 * the next Sync, and no state does. */
static void the_same_grandmaster_changes(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.grandmaster=0xec4670fffe0a1b2c", "time.ptp.max_ppm=1"};
    static const char *const faults[] = {
        "{kind: ptp_grandmaster, from_s: 8.5, until_s: 10.5, grandmaster: 0xec4670fffe0a1b2c, ns: 5000, clock_class: 7}"};
    static const int class[] = {6, 6, 7, 7, 6}, offset_ns[] = {0, -5000, -4000, 2000, 1000};
    static const uint64_t tick[] = {8499, 9999, 10499, 11999, 12500};
    struct rig *rig = follow(sets, 2, faults, 1);
    rig_go_to(rig, 6000);
    expect_events(rig, NULL, 0, 13000, 0);
    for (int i = 0; i < 5; i++) {
        const struct answer a = ask(rig, tick[i]);
        assert_string_equal(a.master, "ec4670.fffe.0a1b2c");
        assert_true(a.class == class[i] && llabs(a.offset_ns - offset_ns[i]) <= 1); /* 1 ppm is 1000 ns a second */
    }
    rig_close(rig);
}

/* A fault that sets the clock itself is an offset for the servo, which steps it back. */
static void a_jump_of_the_clock_is_corrected(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.step_threshold_ns=100000"};
    static const char *const faults[] = {"{kind: clock_jump, from_s: 9.5, jump_s: 0.25}"};
    static const struct said want[] = {
        {10000000000, 8, 0, "SLAVE to UNCALIBRATED on SYNCHRONIZATION_FAULT, servo s2 to s0"},
        {12000000000, 8, 1, "servo s0 to s1"},
        {13000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
    };
    struct rig *rig = follow(sets, 1, faults, 1);
    rig_go_to(rig, 6000);
    expect_events(rig, want, 3, 14000, 0);
    assert_int_equal(ask(rig, 10000).offset_ns, 250000000);
    assert_int_equal(shown_ns(rig, 11999), INT64_C(12249000000));
    assert_int_equal(shown_ns(rig, 12000), 12 * SECOND_NS);
    rig_close(rig);
}

/* ---- the path */

/* Takes what the follower measured at each second from 20 s to 39 s, and the error of the clock. */
static void measure(const char *set, const char *fault, int64_t offset_ns[20], int64_t error_ns[20])
{
    struct rig *rig = follow(&set, set != NULL, &fault, fault != NULL);
    for (int i = 0; i < 20; i++) {
        const uint64_t tick = 1000 * (20 + (uint64_t)i);
        rig_go_to(rig, tick + 1);
        offset_ns[i] = ask(rig, tick).offset_ns;
        error_ns[i] = shown_ns(rig, tick) - (int64_t)tick * 1000000;
    }
    rig_close(rig);
}

/* The follower sees no asymmetry: its offset goes to 0, and the clock is late by the asymmetry, to the floor. */
static void an_asymmetry_is_not_seen(void **state)
{
    (void)state;
    int64_t offset_ns[20], error_ns[20];
    measure("time.ptp.asymmetry_ns=300", NULL, offset_ns, error_ns);
    assert_true(llabs(offset_ns[19]) <= 1 && llabs(error_ns[19] + 300) <= 1);
    measure(NULL, "{kind: ptp_asymmetry, from_s: 8, ns: -700}", offset_ns, error_ns);
    assert_true(llabs(offset_ns[19]) <= 1 && llabs(error_ns[19] - 700) <= 1);
}

/* A measurement differs from the clock's error by the jitter. The jitter is within its limit and goes to both sides. It
 * is the same each time, and another one with another seed. Twenty draws on one side have the probability 2^-19. */
static void jitter_is_bounded_and_repeatable(void **state)
{
    (void)state;
    int64_t a_ns[20], b_ns[20], c_ns[20], error_ns[3][20];
    int same = 0, below = 0;
    measure("time.ptp.jitter_ns=50", NULL, a_ns, error_ns[0]);
    measure(NULL, "{kind: ptp_jitter, ns: 50}", b_ns, error_ns[1]);
    measure("noise.seed=77", "{kind: ptp_jitter, ns: 50}", c_ns, error_ns[2]);
    for (int i = 0; i < 20; i++) {
        assert_true(a_ns[i] == b_ns[i] && error_ns[0][i] == error_ns[1][i]);
        assert_true(llabs(a_ns[i] - error_ns[0][i]) <=
                    50); /* the error at the Sync itself: a rate takes effect later */
        below += a_ns[i] < error_ns[0][i];
        same += a_ns[i] == c_ns[i];
    }
    assert_true(below > 0 && below < 20 && same < 10);
}

/* With 1 ms to make good, the rate stays within 10 ppm, and is at that limit. */
static void the_rate_is_limited(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.max_ppm=10"};
    static const char *const faults[] = {"{kind: ptp_step, from_s: 8.5, ns: 1000000}"};
    struct rig *rig = follow(sets, 1, faults, 1);
    rig_go_to(rig, 20001);
    for (uint64_t s = 9; s < 20; s++)
        assert_int_equal(shown_ns(rig, 1000 * s + 1000) - shown_ns(rig, 1000 * s), SECOND_NS + 10000);
    rig_close(rig);
}

/* ---- power, telemetry, and heads without a follower */

/* Without power the correction of 12 ppm is gone: the clock gains from 10 s on,
 * more than 20 us. */
static void power_ends_it(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.drift_ppm=12"};
    static const char *const faults[] = {"{kind: power_cycle, from_s: 10, for_ms: 1500}"};
    static const struct said again[] = {
        {11700000000, 4, 0, "INITIALIZING to LISTENING on INIT_COMPLETE"},
        {14000000000, 8, 0, "LISTENING to UNCALIBRATED on RS_SLAVE"},
        {15000000000, 8, 1, "servo s0 to s1"},
        {16000000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
    };
    struct rig *rig = follow(sets, 1, faults, 1);
    rig_go_to(rig, 10000);
    const int64_t at_ns = shown_ns(rig, 9999) + 1000000; /* its rate is right to 1e-9 */
    assert_string_equal(ask(rig, 9999).port, "SLAVE");
    expect_events(rig, again, 4, 16500, 0);
    assert_true(llabs(shown_ns(rig, 12000) - at_ns - 2 * SECOND_NS - 24000) <= 1); /* two floors */
    assert_string_equal(ask(rig, 11600).port, "INITIALIZING");
    assert_int_equal(ask(rig, 11600).class, 255);
    rig_close(rig);
}

static void telemetry_has_it(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.ptp.jitter_ns=90", "time.ptp.path_delay_ns=100"};
    struct rig *rig = follow(sets, 2, NULL, 0);
    do
        assert_true(rig_claim(rig));
    while (rig->work.tick != 9000);
    assert_true(rig->work.telemetry);
    const struct native_telemetry *t = &rig->work.telemetry_frame;
    const struct answer a = ask(rig, 9000);
    assert_true(t->ptp_port == 9 && t->ptp_servo == 2 && t->ptp_class == 6 && t->ptp_accuracy == 0x21);
    assert_true(t->ptp_grandmaster == UINT64_C(0x00b0aefffe000001) && t->ptp_flags == NATIVE_PTP_UTC_VALID);
    assert_true(t->ptp_offset_ns == a.offset_ns && t->ptp_delay_ns == a.delay_ns && a.delay_ns != 100);
    rig_close(rig);
}

static void a_head_without_a_follower(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00Z"};
    static const char *const lines[] = {"TIME:PTP?",
                                        "FAULt:ADD {kind: ptp_lost}",
                                        "FAULt:ADD {kind: ptp_no_sync}",
                                        "FAULt:ADD {kind: ptp_faulty}",
                                        "FAULt:ADD {kind: ptp_grandmaster}",
                                        "FAULt:ADD {kind: ptp_step}",
                                        "FAULt:ADD {kind: ptp_asymmetry}",
                                        "FAULt:ADD {kind: ptp_jitter}"};
    struct rig *rig = rig_open(NULL, sets, 1);
    for (int i = 0; i < 8; i++) {
        struct command_result result;
        device_command(rig->device, 1, lines[i], 0, &result);
        assert_true(result.error != 0);
        if (strstr(result.reply, "time.ptp.follower") == NULL) fail_msg("%s: %s", lines[i], result.reply);
    }
    while (rig->next < 5000) {
        assert_true(rig_claim(rig) && rig_event(rig, NATIVE_EV_PTP) == NULL);
        assert_true(!rig->work.telemetry || rig->work.telemetry_frame.ptp_port == NATIVE_PTP_NONE);
    }
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_clock_is_as_computed),
        cmocka_unit_test(the_states_are_those_of_ptp4l),
        cmocka_unit_test(a_faulty_port_outlasts_power),
        cmocka_unit_test(another_grandmaster_has_another_time),
        cmocka_unit_test(the_same_grandmaster_changes),
        cmocka_unit_test(a_jump_of_the_clock_is_corrected),
        cmocka_unit_test(an_asymmetry_is_not_seen),
        cmocka_unit_test(jitter_is_bounded_and_repeatable),
        cmocka_unit_test(the_rate_is_limited),
        cmocka_unit_test(power_ends_it),
        cmocka_unit_test(telemetry_has_it),
        cmocka_unit_test(a_head_without_a_follower),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
