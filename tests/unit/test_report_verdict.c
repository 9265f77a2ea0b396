/* SPDX-License-Identifier: MIT */
/* A report's verdict on a cloud: by its bound, by its noise, or that no verdict is possible. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/report/verdict.h"

/* 1,000 points on smooth faces, all of known noise, with this z. */
static struct figures noisy(double z_mean, double z_rms)
{
    return (struct figures){
        .points = 1000, .along = 1000, .judged = 1000, .noisy = 1000, .z_mean = z_mean, .z_rms = z_rms};
}

static enum report_judgement judge(const struct figures *f)
{
    static const struct deviation_head head;
    const struct report_subject subject = {f, &head, 0, "10 m"};
    struct report_verdict v = {.bound_m = (double)INFINITY}; /* noise has none */
    report_judge_one(&subject, &v);
    return v.judgement;
}

/* For 1,000 points z^2 is within 1 +- (6 sqrt(2 / 1000) + 0.02) = 0.71 to 1.29, and the mean within 6 / sqrt(1000) +
 * 0.01 = 0.20 (verdict.c). So 0.85 to 1.13 for the RMS pass, and 0.83 and 1.15 do not. */
static void test_noise(void **state)
{
    static const struct {
        double z_mean, z_rms;
        enum report_judgement judgement;
    } row[] = {{0, 1, REPORT_WITHIN},     {0, 0.85, REPORT_WITHIN}, {0, 1.13, REPORT_WITHIN},
               {0, 0.83, REPORT_BEYOND},  {0, 1.15, REPORT_BEYOND}, {0.19, 1, REPORT_WITHIN},
               {-0.19, 1, REPORT_WITHIN}, {0.21, 1, REPORT_BEYOND}, {-0.21, 1, REPORT_BEYOND}};
    (void)state;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const struct figures f = noisy(row[i].z_mean, row[i].z_rms);
        if (judge(&f) != row[i].judgement) fail_msg("mean %g, RMS %g", row[i].z_mean, row[i].z_rms);
    }
    struct figures few = noisy(0, 1);
    few.noisy = 99;
    assert_int_equal(judge(&few), REPORT_NONE);
    few = noisy(0, 1);
    few.far = 1;
    assert_int_equal(judge(&few), REPORT_BEYOND);
}

/* By the bound: with a footprint, points beside smooth faces don't count. The bound is 1.001 mm here: ideal encoders,
 * no counts. */
static void test_bound(void **state)
{
    struct deviation_head head = {.setup = {.layout = LINE_GEO, .mirror_counts = 0x1p32, .pan_counts = 0x1p32},
                                  .cast_error_m = 1e-6,
                                  .georef_error_m = 1e-3};
    struct report_verdict v = {.judged = 0};
    static const struct cast_beam beam;
    (void)state;
    report_count(&v, &head, 0.9e-3, (double)NAN, 10.0);
    report_count(&v, &head, 1.1e-3, (double)NAN, 10.0);
    report_count(&v, &head, (double)NAN, (double)NAN, 10.0);
    assert_true(v.judged == 2 && v.beyond == 1);
    head.setup.beam = &beam;
    report_count(&v, &head, 1.1e-3, (double)NAN, 10.0);
    assert_true(v.judged == 2 && v.beyond == 1);
    report_count(&v, &head, 1.1e-3, 1.1e-3, 10.0);
    assert_true(v.judged == 3 && v.beyond == 2);
}

/* ---- what is said */

static void expect(const struct figures *f, struct deviation_head head, int moving, const struct report_verdict *begun,
                   enum report_judgement judgement, const char *text)
{
    const struct report_subject subject = {f, &head, moving, "--max-m"};
    struct report_verdict v = *begun;
    report_judge_one(&subject, &v);
    if (v.judgement != judgement || strcmp(v.text, text) != 0) fail_msg("%d: %s", v.judgement, v.text);
}

/* The first reason counts: no points, a head that moved, errors of the instrument, far points. */
static void test_texts(void **state)
{
    static const struct deviation_head plain, wrong = {.has_instrument_errors = 1};
    static const struct report_verdict none = {.bound_m = (double)INFINITY};
    static const struct cast_beam beam;
    const struct deviation_head wide = {.setup.beam = &beam};
    struct figures f = {.far = 3};
    (void)state;
    assert_string_equal(report_judgement_name(REPORT_WITHIN), "within");
    assert_string_equal(report_judgement_name(REPORT_BEYOND), "beyond");
    assert_string_equal(report_judgement_name(REPORT_NONE), "not judged");
    expect(&f, wrong, 1, &none, REPORT_NONE, "Not judged: there is no point of this station.");
    f.points = 10;
    expect(&f, wrong, 1, &none, REPORT_NONE,
           "Not judged: the head moved, and the file doesn't say where each pulse began.");
    expect(&f, wrong, 0, &none, REPORT_NONE,
           "Not judged: the configuration has errors of the instrument, which move points on purpose.");
    expect(&f, plain, 0, &none, REPORT_BEYOND,
           "Not within the expected error: 3 of 10 points are farther from everything than --max-m.");
    f = (struct figures){.points = 10, .along = 4, .max_m = 0.002};
    expect(
        &f, plain, 0, &none, REPORT_NONE,
        "Not judged: only 4 of 10 points lie on smooth faces, and only those are judged; at least half of all points "
        "must lie there.");
    f.along = 5;
    f.noisy = 99;
    expect(&f, plain, 0, &none, REPORT_NONE,
           "Not judged: only 99 points on smooth faces have a known noise; 100 are needed.");
    expect(
        &f, plain, 0, &(struct report_verdict){.judged = 10, .bound_m = 0.00125}, REPORT_WITHIN,
        "Within the expected error: no point is farther from the scene than its bound, 1.25 mm at the largest range. "
        "The bound is the plan's, plus half a count on each axis.");
    expect(&f, wide, 0, &(struct report_verdict){.judged = 5, .beyond = 2, .bound_m = 0.00125}, REPORT_BEYOND,
           "Not within the expected error: 2 of 5 points on smooth faces are farther from the scene than their bound, "
           "1.25 mm at the largest range; the largest distance is 2 mm.");
    /* With a footprint half of the points must be on smooth faces, unless one of them is beyond its bound already. */
    expect(
        &f, wide, 0, &(struct report_verdict){.judged = 5, .bound_m = 0.00125}, REPORT_WITHIN,
        "Within the expected error: no point on smooth faces is farther from the scene than its bound, 1.25 mm at the "
        "largest range. The bound is the plan's, plus half a count on each axis.");
    f.along = 4;
    expect(
        &f, wide, 0, &(struct report_verdict){.judged = 4, .bound_m = 0.00125}, REPORT_NONE,
        "Not judged: only 4 of 10 points lie on smooth faces, and only those are judged; at least half of all points "
        "must lie there.");
}

/* For 1,000 points: 6 sqrt(2 / 1000) + 0.02 = 0.28833, and its roots from 1 on are 0.8436 and 1.1350. The mean has 6 /
 * sqrt(1000) + 0.01 = 0.1997. Counts of a tenth of sigma add 0.1 to that, and three times their square to the upper
 * limit: sqrt(1.31833) = 1.1482. */
static void test_text_of_noise(void **state)
{
    static const struct deviation_head head;
    (void)state;
    for (int counts = 0; counts < 2; counts++) {
        struct figures f = noisy(-0.125, 1.0625);
        struct report_verdict v = {.bound_m = (double)INFINITY};
        const struct report_subject subject = {&f, &head, 0, "--max-m"};
        char want[512];
        f.judged_rms_m = 0.0031;
        f.expected_rms_m = 0.003;
        f.noisy = 1000;
        f.z_counts = counts ? 0.1 : 0.0;
        report_judge_one(&subject, &v);
        snprintf(
            want, sizeof want,
            "Within the expected error: along the beam, the RMS deviation of 1000 points on smooth faces is 3.1 mm, "
            "and 3 mm is expected from noise and counts. Deviation over expected sigma: RMS 1.0625, allowed 0.8436 to "
            "%s; mean -0.1250, allowed %s to both sides.",
            counts ? "1.1482" : "1.1350", counts ? "0.2997" : "0.1997");
        assert_string_equal(v.text, want);
        assert_true(v.judged == 1000 && v.judgement == REPORT_WITHIN);
        assert_true(fabs(v.least_ratio - 0.8436) < 1e-4 && fabs(v.most_ratio - (counts ? 1.1482 : 1.1350)) < 1e-4);
    }
    const struct figures few = {.points = 100, .along = 100, .noisy = 100, .z_rms = 1.0};
    assert_int_equal(judge(&few), REPORT_WITHIN); /* 100 are enough */
}

/* The largest bound is kept. It grows with the range, so it is that of the farthest point. */
static void test_largest_bound(void **state)
{
    const struct deviation_head head = {.setup = {.layout = LINE_POLAR, .mirror_counts = 1e3, .pan_counts = 1e3},
                                        .cast_error_m = 1e-6};
    struct report_verdict v = {.judged = 0};
    (void)state;
    report_count(&v, &head, 0.0, 0.0, 10.0);
    report_count(&v, &head, 0.0, 0.0, 20.0);
    const double most_m = v.bound_m;
    report_count(&v, &head, 0.0, 0.0, 5.0);
    report_count(&v, &head, 0.0, 0.0, (double)NAN); /* without a range there is no bound */
    assert_true(v.bound_m == most_m && most_m == deviation_bound_m(&head, 20.0) && v.judged == 3);
    report_count(&v, &head, most_m, 0.0, 20.0); /* at the bound is within it */
    assert_int_equal(v.beyond, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_noise), cmocka_unit_test(test_bound),
                                       cmocka_unit_test(test_texts), cmocka_unit_test(test_text_of_noise),
                                       cmocka_unit_test(test_largest_bound)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
