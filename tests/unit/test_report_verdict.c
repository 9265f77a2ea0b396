/* SPDX-License-Identifier: MIT */
/* A report's verdict on a cloud: by its bound, by its noise, or that no verdict is possible. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_noise), cmocka_unit_test(test_bound)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
