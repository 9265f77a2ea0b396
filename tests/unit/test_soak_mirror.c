/* SPDX-License-Identifier: MIT */
/* Faults of the mirror and the laser in a soak, by the points that its client gets: each shows from its bound on. A
 * frame has 11 points over 1 ms. The mirror's usual rate is 10 rad/s. Points are the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/config/config.h"

#define MS INT64_C(1000000)

enum { POINTS = 11 };

static struct config cfg;
static struct soak *soak;
static struct soak_link *at;
static double rate;     /* of the mirror, within the next frame */
static double from_rad; /* where the mirror stands at its first point */
static int echoes;      /* of the last point; the others have none */
static int broken;      /* the point of that number can't be decoded; -1: none */
static int64_t span_ns;

int scanhead_points(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, struct scanhead_point *out,
                    uint32_t max)
{
    if (sh != NULL || max != 1 || (int)first == broken) return SCANHEAD_EFORMAT;
    const double t_s = 1e-9 * (double)span_ns * first / (POINTS - 1);
    *out = (struct scanhead_point){.t_ns = 100 + llround(1e9 * t_s),
                                   .mirror_rad = remainder(from_rad + rate * t_s, 2.0 * M_PI),
                                   .echo_count = (uint8_t)(first + 1 == frame->n_points ? echoes : 0)};
    return 1;
}

static int make(void **state)
{
    (void)state;
    memset(&cfg, 0, sizeof cfg);
    cfg.profile.emitter.kind = EMITTER_LINE;
    cfg.output.layout = LINE_POLAR;
    soak = calloc(1, sizeof *soak);
    if (soak == NULL) return -1;
    soak->cfg = &cfg;
    soak->n_links = 1;
    soak->faults.n = 1;
    at = &soak->link[0];
    at->soak = soak;
    at->usable = at->begun = 1;
    rate = 10.0;
    from_rad = 0.0;
    echoes = 1;
    broken = -1;
    span_ns = MS;
    return pthread_mutex_init(&at->lock, NULL);
}

static int end(void **state)
{
    (void)state;
    free(soak);
    return 0;
}

static void fault_is(const struct fault *what, int64_t from_ms, int64_t to_ms)
{
    soak->faults.fault[0] = *what;
    const struct fault_note begins = {.fault = 1, .kind = what->kind, .t_ns = from_ms * MS};
    const struct fault_note ends = {.fault = 1, .kind = what->kind, .t_ns = to_ms * MS, .ended = 1};
    soak_heard_head(at, &begins);
    if (to_ms != 0) soak_heard_head(at, &ends);
}

static uint64_t pulse0;

static void points_of(uint32_t n, int64_t t_ms)
{
    const struct scanhead_frame frame = {.type = SCANHEAD_POINTS, .n_points = n, .t_ns = t_ms * MS, .pulse0 = pulse0++};
    soak_saw_inside(at, &frame);
    at->frames++;
}

static void points(int64_t t_ms)
{
    points_of(POINTS, t_ms);
}

/* Checks whether a fault that begins at 100 ms is noticed at a rate, in a frame at 150 ms. */
static void expect_at(const struct fault *what, double at_rate, int noticed)
{
    end(NULL);
    make(NULL);
    points(50);
    fault_is(what, 100, 0);
    rate = at_rate;
    points(150);
    if ((int)at->row[what->kind].noticed != noticed) fail_msg("kind %d at %g rad/s", what->kind, at_rate);
}

/* A slow mirror turns at a share of its rate, with a quarter of the rest as margin; a stuck one at less than a
 * hundredth; a wobbling one differs by a quarter of its largest change of rate, 2 pi hz deg. */
static void bounds(void **state)
{
    const struct fault slow = {.kind = FAULT_MIRROR_SLOW, .factor = 0.6}, stuck = {.kind = FAULT_MIRROR_STUCK},
                       wobble = {.kind = FAULT_MIRROR_WOBBLE, .hz = 2.0, .deg = -9.0};
    const double change = 0.25 * 2.0 * M_PI * 2.0 * (9.0 * M_PI / 180.0);
    (void)state;
    expect_at(&slow, 6.0, 1);
    expect_at(&slow, 6.99, 1);
    expect_at(&slow, 7.01, 0);
    expect_at(&slow, 5.01, 1);
    expect_at(&slow, 4.99, 0);
    expect_at(&slow, 10.0, 0);
    expect_at(&stuck, 0.0, 1);
    expect_at(&stuck, 0.099, 1);
    expect_at(&stuck, -0.099, 1);
    expect_at(&stuck, 0.101, 0);
    expect_at(&stuck, -0.101, 0);
    expect_at(&wobble, 10.0 + 1.01 * change, 1);
    expect_at(&wobble, 10.0 + 0.99 * change, 0);
    expect_at(&wobble, 10.0 - 1.01 * change, 1);
    expect_at(&wobble, 10.0 - 0.99 * change, 0);
}

/* The rate counts across the encoder's wrap, and a frame without two times has none. */
static void rates(void **state)
{
    const struct fault stuck = {.kind = FAULT_MIRROR_STUCK};
    (void)state;
    from_rad = M_PI - 0.004;
    points(50);
    assert_true(fabs(at->usual_rate - 10.0) < 1e-6);
    end(NULL);
    make(NULL);
    points_of(1, 40);
    span_ns = 0;
    points(41);
    span_ns = MS;
    broken = 0;
    points(42);
    broken = POINTS - 1;
    points(43);
    assert_true(at->usual_rate == 0.0);
    broken = -1;
    points_of(2, 44);
    assert_true(fabs(at->usual_rate - 10.0) < 1e-6);
    rate = 20.0;
    points(45);
    assert_true(fabs(at->usual_rate - 10.0) < 1e-6); /* the first one stays */
    fault_is(&stuck, 50, 0);
    rate = 0.0;
    points(49); /* before the fault */
    assert_int_equal(at->row[FAULT_MIRROR_STUCK].noticed, 0);
    points(50);
    assert_int_equal(at->row[FAULT_MIRROR_STUCK].noticed, 1);
    fault_is(&stuck, 60, 70);
    points(70); /* it is over */
    assert_int_equal(at->row[FAULT_MIRROR_STUCK].noticed, 1);
    points(69);
    assert_int_equal(at->row[FAULT_MIRROR_STUCK].noticed, 2);
}

/* A rate within a fault is not the usual one. A fault that ended before is hidden: there was nothing to compare with.
 */
static void scans_that_begin_with_a_fault(void **state)
{
    const struct fault slow = {.kind = FAULT_MIRROR_SLOW, .factor = 0.6}, laser = {.kind = FAULT_LASER_OFF};
    (void)state;
    fault_is(&slow, 10, 20);
    points(10);
    points(19);
    assert_true(at->usual_rate == 0.0 && at->n_moments == 1);
    points(20);
    assert_true(at->usual_rate != 0.0 && at->n_moments == 0);
    assert_int_equal(at->row[FAULT_MIRROR_SLOW].hidden, 1);
    assert_string_equal(at->row[FAULT_MIRROR_SLOW].why,
                        "the fault was over before the client knew the mirror's usual rate");
    end(NULL);
    make(NULL);
    fault_is(&laser, 10, 0); /* it is not one of the mirror */
    points(15);
    assert_true(at->usual_rate != 0.0 && at->n_moments == 1 && at->row[FAULT_LASER_OFF].hidden == 0);
    end(NULL);
    make(NULL);
    fault_is(&slow, 30, 0); /* it begins later */
    points(29);
    assert_true(at->usual_rate != 0.0 && at->n_moments == 1);
}

/* Without the laser each shot is empty. A frame without shots says nothing. */
static void a_laser_that_is_off(void **state)
{
    const struct fault laser = {.kind = FAULT_LASER_OFF};
    (void)state;
    points(5);
    fault_is(&laser, 10, 0);
    points(15);
    assert_int_equal(at->row[FAULT_LASER_OFF].noticed, 0); /* the last shot has an echo */
    echoes = 0;
    points_of(0, 16);
    broken = 3;
    points(17);
    assert_int_equal(at->row[FAULT_LASER_OFF].noticed, 0);
    broken = -1;
    points_of(1, 18);
    assert_int_equal(at->row[FAULT_LASER_OFF].noticed, 1);
}

/* Points and the follower's states say nothing of other faults. */
static void other_faults(void **state)
{
    const struct scanhead_frame ptp = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_PTP, .t_ns = 20 * MS};
    static const enum fault_kind kinds[] = {FAULT_SELF_TEST, FAULT_CLOCK_JUMP, FAULT_PPS_LOST};
    (void)state;
    points(5);
    for (int i = 0; i < 3; i++) {
        fault_is(&(struct fault){.kind = kinds[i]}, 10, 0);
        points(15);
        soak_saw_inside(at, &ptp);
        assert_int_equal(at->row[kinds[i]].noticed, 0);
        assert_int_equal(at->n_moments, i + 1);
    }
}

/* A scan that begins anew shows that power was away. */
static void pulses_begin_anew(void **state)
{
    const struct fault power = {.kind = FAULT_POWER_CYCLE};
    (void)state;
    pulse0 = 500;
    points(5);
    fault_is(&power, 10, 0);
    points(15);
    assert_int_equal(at->row[FAULT_POWER_CYCLE].noticed, 0);
    pulse0 = 501; /* the same pulse again is no new scan */
    points(16);
    assert_int_equal(at->row[FAULT_POWER_CYCLE].noticed, 0);
    pulse0 = 0;
    points(17);
    assert_int_equal(at->row[FAULT_POWER_CYCLE].noticed, 1);
    fault_is(&power, 30, 0);
    pulse0 = 0;
    points(20); /* power goes later */
    assert_int_equal(at->row[FAULT_POWER_CYCLE].noticed, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(bounds, make, end),
        cmocka_unit_test_setup_teardown(rates, make, end),
        cmocka_unit_test_setup_teardown(scans_that_begin_with_a_fault, make, end),
        cmocka_unit_test_setup_teardown(a_laser_that_is_off, make, end),
        cmocka_unit_test_setup_teardown(other_faults, make, end),
        cmocka_unit_test_setup_teardown(pulses_begin_anew, make, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
