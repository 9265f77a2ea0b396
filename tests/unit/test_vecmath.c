/* SPDX-License-Identifier: MIT */
/* core/vecmath.h against the long double functions of libm, whose 64-bit mantissa is 2048 times finer than a
 * double's. */
#include "tests/common/cases.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "core/vecmath.h"

enum { CASES = 1000000 };
static const double SINCOS_ERROR = 2.5e-16; /* as the header promises */
static const double LOG_ERROR = 1e-15;      /* likewise, relative */

static int need_long_double(void **state)
{
    (void)state;
    return LDBL_MANT_DIG >= 64 ? 0 : -1;
}

/* fmodl is exact. The remainder is below a turn, where the rounding of 2 pi costs less than 4e-19. */
static double sincos_error(double turn)
{
    const long double two_pi = 6.283185307179586476925286766559L;
    long double rad = two_pi * fmodl((long double)turn, 1.0L);
    double s, c;
    vec_sincos_turn(turn, &s, &c);
    long double es = fabsl((long double)s - sinl(rad)), ec = fabsl((long double)c - cosl(rad));
    return (double)(es > ec ? es : ec);
}

static void sine_and_cosine_of_a_million_turns(void **state)
{
    (void)state;
    uint64_t seed = 1;
    double worst = 0.0, at = 0.0;
    for (int i = 0; i < CASES; i++) {
        int scale = (int)case_between(&seed, 0, 3) == 0 ? (int)case_between(&seed, -60, 40) : 1;
        double turn = ldexp(2.0 * case_unit(&seed) - 1.0, scale), error = sincos_error(turn);
        if (error > worst) {
            worst = error;
            at = turn;
        }
    }
    print_message("# sine, cosine: worst error %.3g at %.17g turns\n", worst, at);
    if (!(worst < SINCOS_ERROR)) fail_msg("error %.3g at %.17g turns", worst, at);
}

/* The reduction changes its branch at eighths of a turn, so these and the doubles beside them are tried. */
static void sine_and_cosine_beside_every_eighth(void **state)
{
    (void)state;
    for (int turns = -3; turns <= 3; turns++)
        for (int eighth = 0; eighth < 8; eighth++) {
            double edge = turns + eighth / 8.0;
            double turn[] = {edge, nextafter(edge, -9.0), nextafter(edge, 9.0), edge - 1e-9, edge + 1e-9};
            for (size_t i = 0; i < sizeof turn / sizeof *turn; i++)
                if (!(sincos_error(turn[i]) < SINCOS_ERROR))
                    fail_msg("error %.3g at %.17g turns", sincos_error(turn[i]), turn[i]);
        }
}

static void quarter_turns_are_exact(void **state)
{
    (void)state;
    static const double sine[] = {0, 1, 0, -1}, cosine[] = {1, 0, -1, 0};
    for (int64_t q = -8; q <= 8; q++) {
        for (int far = 0; far < 2; far++) {
            double turn = (double)q / 4.0 + (far ? 1099511627776.0 : 0.0), s, c;
            vec_sincos_turn(turn, &s, &c);
            if (s != sine[q & 3] || c != cosine[q & 3]) fail_msg("%.17g turns: %.17g, %.17g", turn, s, c);
        }
    }
}

/* A turn more changes nothing, down to the last bit, as long as the sum is exact. */
static void whole_turns_change_nothing(void **state)
{
    (void)state;
    uint64_t seed = 2;
    for (int i = 0; i < 100000; i++) {
        double part = (double)case_between(&seed, -4095, 4095) / 4096.0;
        double turns = (double)case_between(&seed, -(INT64_C(1) << 40), INT64_C(1) << 40);
        double s, c, s_far, c_far;
        vec_sincos_turn(part, &s, &c);
        vec_sincos_turn(part + turns, &s_far, &c_far);
        if (s != s_far || c != c_far) fail_msg("%.17g turns and %.17g more differ", part, turns);
    }
}

/* |s^2 + c^2 - 1| <= 2 (|s| ds + |c| dc) to first order, at most 2 sqrt(2) times the error of one. */
static void they_lie_on_the_unit_circle(void **state)
{
    (void)state;
    uint64_t seed = 3;
    double worst = 0.0;
    for (int i = 0; i < CASES; i++) {
        double s, c;
        vec_sincos_turn(4.0 * case_unit(&seed) - 2.0, &s, &c);
        double off = (double)fabsl((long double)s * s + (long double)c * c - 1.0L);
        if (off > worst) worst = off;
    }
    assert_true(worst <= 2.0 * sqrt(2.0) * SINCOS_ERROR);
}

/* The angle is finer than a double: a double and its remainder. Sine and cosine come as two doubles each, too. */
static void fine_sine_and_cosine(void **state)
{
    (void)state;
    const long double two_pi = 6.283185307179586476925286766559L;
    uint64_t seed = 6;
    double worst = 0.0, at = 0.0;
    for (int i = 0; i < CASES; i++) {
        double turn = 6.0 * case_unit(&seed) - 3.0, rest = (2.0 * case_unit(&seed) - 1.0) * 2e-16, s[2], c[2];
        long double rad = two_pi * (fmodl((long double)turn, 1.0L) + (long double)rest);
        vec_sincos_turn_fine(turn, rest, s, c);
        double es = (double)fabsl((long double)s[0] + s[1] - sinl(rad));
        double ec = (double)fabsl((long double)c[0] + c[1] - cosl(rad)), error = es > ec ? es : ec;
        if (error > worst) {
            worst = error;
            at = turn;
        }
        assert_true(s[0] + s[1] == s[0] && c[0] + c[1] == c[0]);
    }
    print_message("# fine sine, cosine: worst error %.3g at %.17g turns\n", worst, at);
    assert_true(worst < 4e-17);
}

static double log_error(double x)
{
    long double expected = logl((long double)x);
    long double error = fabsl((long double)vec_log(x) - expected);
    return expected == 0.0L ? (double)error : (double)(error / fabsl(expected));
}

/* libm's expl is good to 64 bits. */
static void exponential_of_a_million_numbers(void **state)
{
    (void)state;
    uint64_t seed = 5;
    double worst = 0.0, at = 0.0;
    for (int i = 0; i < CASES; i++) {
        double x = (i % 2 ? 1400.0 : 2.0) * (case_unit(&seed) - 0.5);
        long double expected = expl((long double)x);
        double error = (double)fabsl(((long double)vec_exp(x) - expected) / expected);
        if (error > worst) {
            worst = error;
            at = x;
        }
    }
    print_message("# exponential: worst relative error %.3g at %.17g\n", worst, at);
    if (!(worst < LOG_ERROR)) fail_msg("relative error %.3g at %.17g", worst, at);
    assert_true(vec_exp(0.0) == 1.0 && vec_exp(-1e6) == vec_exp(-700.0) && vec_exp(1e6) == vec_exp(700.0));
}

static void logarithm_of_a_million_numbers(void **state)
{
    (void)state;
    uint64_t seed = 4;
    double worst = 0.0, at = 0.0;
    for (int i = 0; i < CASES; i++) {
        double x = ldexp(1.0 + case_unit(&seed),
                         i % 2 ? (int)case_between(&seed, -33, 0) : (int)case_between(&seed, -1022, 1022));
        double error = log_error(x);
        if (error > worst) {
            worst = error;
            at = x;
        }
    }
    print_message("# logarithm: worst relative error %.3g at %.17g\n", worst, at);
    if (!(worst < LOG_ERROR)) fail_msg("relative error %.3g at %.17g", worst, at);
}

/* The ends of the range, the joints of the reduction, and the neighbourhood of 1, where the result goes through 0. */
static void logarithm_at_its_edges(void **state)
{
    (void)state;
    assert_true(vec_log(1.0) == 0.0);
    const double root_half = sqrt(0.5);
    double x[] = {DBL_MIN,
                  DBL_MAX,
                  0.5,
                  2.0,
                  root_half,
                  nextafter(root_half, 0),
                  nextafter(root_half, 1),
                  2.0 * root_half,
                  nextafter(2.0 * root_half, 0),
                  0x1p-33,
                  1.0 - 0x1p-33,
                  1.0 - 0x1p-53,
                  1.0 + 0x1p-52,
                  0.999,
                  1.001};
    for (size_t i = 0; i < sizeof x / sizeof *x; i++)
        if (!(log_error(x[i]) < LOG_ERROR)) fail_msg("relative error %.3g at %.17g", log_error(x[i]), x[i]);
}

static void rounding_takes_ties_to_even(void **state)
{
    (void)state;
    static const struct {
        double x, rounded;
    } is[] = {{0.5, 0},
              {1.5, 2},
              {2.5, 2},
              {-0.5, 0},
              {-1.5, -2},
              {-2.5, -2},
              {0.25, 0},
              {-0.75, -1},
              {0x1.fffffffffffffp-2, 0},
              {4294967295.5, 4294967296.0},
              {4294967294.5, 4294967294.0},
              {0x1p51 - 1.5, 0x1p51 - 2.0},
              {-0x1p51 + 1.5, -0x1p51 + 2.0},
              {0x1p51 - 1.0, 0x1p51 - 1.0}};
    for (size_t i = 0; i < sizeof is / sizeof *is; i++) {
        uint64_t bits;
        double rounded = vec_round(is[i].x, &bits);
        if (rounded != is[i].rounded) fail_msg("%.17g rounds to %.17g, not %.17g", is[i].x, rounded, is[i].rounded);
        assert_int_equal((uint32_t)bits, (uint32_t)(int64_t)is[i].rounded);
    }
}

static void rounding_is_that_of_the_c_library(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int i = 0; i < CASES; i++) {
        double x = ldexp(2.0 * case_unit(&seed) - 1.0, (int)case_between(&seed, -2, 50));
        uint64_t bits;
        double rounded = vec_round(x, &bits);
        if (rounded != nearbyint(x) || (uint32_t)bits != (uint32_t)(int64_t)nearbyint(x))
            fail_msg("%.17g rounds to %.17g", x, rounded);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sine_and_cosine_of_a_million_turns),
        cmocka_unit_test(sine_and_cosine_beside_every_eighth),
        cmocka_unit_test(quarter_turns_are_exact),
        cmocka_unit_test(whole_turns_change_nothing),
        cmocka_unit_test(they_lie_on_the_unit_circle),
        cmocka_unit_test(fine_sine_and_cosine),
        cmocka_unit_test(logarithm_of_a_million_numbers),
        cmocka_unit_test(exponential_of_a_million_numbers),
        cmocka_unit_test(logarithm_at_its_edges),
        cmocka_unit_test(rounding_takes_ties_to_even),
        cmocka_unit_test(rounding_is_that_of_the_c_library),
    };
    return cmocka_run_group_tests_name("vecmath", tests, need_long_double, NULL);
}
