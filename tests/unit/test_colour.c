/* SPDX-License-Identifier: MIT */
/* Colours that show figures, by the words of core/colour.h and the formulas of IEC 61966-2-1. */
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "tests/common/cases.h"

static void expect(const uint8_t rgb[3], int red, int green, int blue)
{
    if (rgb[0] != red || rgb[1] != green || rgb[2] != blue)
        fail_msg("%d %d %d instead of %d %d %d", rgb[0], rgb[1], rgb[2], red, green, blue);
}

/* Blue, green, yellow, red at thirds; straight lines between, to the nearest step. */
static void the_ramp(void **state)
{
    (void)state;
    static const struct {
        double part;
        int rgb[3];
    } is[] = {{-1.0, {0, 0, 255}},         {0.0, {0, 0, 255}},         {1.0 / 12.0, {0, 64, 191}},
              {1.0 / 3.0, {0, 255, 0}},    {5.0 / 12.0, {64, 255, 0}}, {2.0 / 3.0, {255, 255, 0}},
              {11.0 / 12.0, {255, 64, 0}}, {1.0, {255, 0, 0}},         {2.0, {255, 0, 0}}};
    uint8_t rgb[3];
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        colour_ramp(is[i].part, rgb);
        expect(rgb, is[i].rgb[0], is[i].rgb[1], is[i].rgb[2]);
        colour_between(-20.0, 40.0, -20.0 + 60.0 * is[i].part, rgb); /* between two limits */
        expect(rgb, is[i].rgb[0], is[i].rgb[1], is[i].rgb[2]);
    }
    colour_ramp((double)NAN, rgb);
    expect(rgb, 96, 128, 255);
    colour_between(0.0, 1.0, (double)NAN, rgb);
    expect(rgb, 96, 128, 255);
    colour_between(5.0, 5.0, (double)NAN, rgb);
    expect(rgb, 96, 128, 255);
    colour_between(5.0, 5.0, 9.0, rgb); /* all blue where both limits are the same */
    expect(rgb, 0, 0, 255);
    colour_between(6.0, 5.0, 5.5, rgb);
    expect(rgb, 0, 0, 255);
    expect(colour_grey, 128, 128, 128);
    expect(colour_unknown, 96, 128, 255);
    assert_int_equal(colour_packed((const uint8_t[3]){0x12, 0xf4, 0x56}), 0x12f456);
}

static void reflectances(void **state)
{
    (void)state;
    uint8_t rgb[3];
    for (int db = -40; db <= 10; db++) {
        const double grey = db <= -30 ? 0.0 : db >= 0 ? 255.0 : 255.0 * (db + 30) / 30.0;
        colour_reflectance(db, rgb);
        assert_true(fabs(rgb[0] - grey) < 0.501 && rgb[1] == rgb[0] && rgb[2] == rgb[0]);
    }
    colour_reflectance((double)NAN, rgb);
    expect(rgb, 96, 128, 255);
}

/* The hue goes on by the golden section of a turn. Channels go from 64 to 240: full within a sixth of a turn from their
 * own hue, nothing beyond a third. */
static void numbers(void **state)
{
    (void)state;
    for (uint32_t number = 0; number < 40; number++) {
        const double hue = fmod(number * (sqrt(5.0) - 1.0) / 2.0, 1.0);
        uint8_t rgb[3];
        colour_number(number, rgb);
        for (int i = 0; i < 3; i++) {
            const double away = 6.0 * fabs(remainder(hue - i / 3.0, 1.0)); /* in sixths */
            const double part = away <= 1.0 ? 1.0 : away >= 2.0 ? 0.0 : 2.0 - away;
            assert_true(fabs(rgb[i] - (64.0 + 176.0 * part)) < 0.501);
        }
    }
}

static void linear_light(void **state)
{
    (void)state;
    static const double points[][2] = {{0.0, 0.0}, {0.001, 0.01292},        {0.0031308, 0.0404499}, {0.2140411405, 0.5},
                                       {1.0, 1.0}, {0.0512694, 0.25098039}, {-0.001, -0.01292}};
    for (size_t i = 0; i < sizeof points / sizeof points[0]; i++) {
        assert_true(fabs(colour_srgb_encode(points[i][0]) - points[i][1]) < 1e-6);
        assert_true(fabs(colour_srgb_decode(points[i][1]) - points[i][0]) < 1e-6);
    }
    assert_true(colour_srgb_encode(2.0) > 1.3 && colour_srgb_decode(1.5) > 2.0); /* above 1 stays above 1 */
}

static void words(void **state)
{
    (void)state;
    static const char *const want[] = {"none", "solid", "range", "height", "reflectance", "label", "frame", "texture"};
    assert_int_equal(COLOUR_MODES, 8);
    for (int k = 0; k < COLOUR_MODES; k++) {
        assert_string_equal(colour_words[k], want[k]);
        assert_int_equal(colour_has_limits((enum colour_mode)k),
                         k == COLOUR_RANGE || k == COLOUR_HEIGHT || k == COLOUR_FRAME);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_ramp),     cmocka_unit_test(reflectances), cmocka_unit_test(numbers),
        cmocka_unit_test(linear_light), cmocka_unit_test(words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
