/* SPDX-License-Identifier: MIT */
/* Each number of a pose is tried at its limit, and one beyond. */
#include "tests/unit/command_device.h"

struct part {
    const char *name, *unit;
    int most;
};

/* Writes "HEADER FIRST,0,..,VALUE,..,0" with the value as number i of 6. */
static void write_pose(char line[128], const char *begin, int i, int value, const char *fraction)
{
    int n = snprintf(line, 128, "%s", begin);
    for (int k = 0; k < 6; k++)
        n += snprintf(line + n, (size_t)(128 - n), ",%d%s", k == i ? value : 0, k == i ? fraction : "");
}

static void expect_limits(struct command_device *dev, const char *begin, const char *header, const struct part part[6],
                          const double *pose)
{
    char line[128], want[160];
    for (int i = 0; i < 6; i++)
        for (int sign = -1; sign <= 1; sign += 2) {
            write_pose(line, begin, i, sign * part[i].most, "");
            expect(dev, line, "OK");
            for (int k = 0; k < 6; k++)
                assert_true(pose[k] == (k == i ? sign * part[i].most : 0));
            write_pose(line, begin, i, sign * part[i].most, ".5");
            snprintf(want, sizeof want, "ERR -222,\"Data out of range; %s: %s %.12g, allowed -%.10g to %.10g %s\"",
                     header, part[i].name, sign * (part[i].most + 0.5), (double)part[i].most, (double)part[i].most,
                     part[i].unit);
            expect(dev, line, want);
        }
}

static void each_number_of_a_pose_has_its_limits(void **state)
{
    (void)state;
    enum { FAR_M = 1000000000 };
    static const struct part of_site[6] = {{"x", "m", FAR_M},       {"y", "m", FAR_M},    {"z", "m", FAR_M},
                                           {"heading", "deg", 360}, {"pitch", "deg", 90}, {"roll", "deg", 180}};
    static const struct part of_step[6] = {{"x", "m", FAR_M},    {"y", "m", FAR_M},    {"z", "m", FAR_M},
                                           {"roll", "deg", 360}, {"pitch", "deg", 90}, {"heading", "deg", 360}};
    struct command_device dev = command_test_device();
    dev.step_allowed = dev.pose_allowed = 1;
    dev.pose_reach_m = FAR_M;
    expect_limits(&dev, "SITE:POSE 2", "SITE:POSE", of_site, result.place.v);
    assert_int_equal(result.station, 2);
    expect_limits(&dev, "TIME:STEP 5", "TIME:STEP", of_step, result.pose);
    expect(&dev, "SITE:POSE? 1,MAX", "1000000000,1000000000,1000000000,360,90,180");
    expect(&dev, "SITE:POSE? 1,MIN", "-1000000000,-1000000000,-1000000000,-360,-90,-180");
}

/* A number may have its own unit, and no other. */
static void each_number_of_a_pose_has_its_unit(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    dev.step_allowed = dev.pose_allowed = 1;
    dev.pose_reach_m = 100.0;
    expect(&dev, "SITE:POSE 3,1 m,2M,3 M,4 deg,5DEG,6 DEG", "OK");
    expect(&dev, "TIME:STEP 5 ns,1 m,2M,3 M,4 deg,5DEG,6 DEG", "OK");
    assert_true(result.have_pose && result.pose[0] == 1.0 && result.pose[5] == 6.0 && result.step_ns == 5);
    static const char *const name[2][6] = {{"x", "y", "z", "heading", "pitch", "roll"},
                                           {"x", "y", "z", "roll", "pitch", "heading"}};
    static const char *const header[2] = {"SITE:POSE", "TIME:STEP"};
    for (int c = 0; c < 2; c++)
        for (int i = 0; i < 6; i++) {
            char line[128], begin[16], want[128];
            const char *others = i < 3 ? "deg" : "m";
            snprintf(begin, sizeof begin, "%s 1", header[c]);
            write_pose(line, begin, i, 1, others);
            snprintf(want, sizeof want, "ERR -131,\"Invalid suffix; '%s'; %s of %s takes %s\"", others, name[c][i],
                     header[c], i < 3 ? "M" : "DEG");
            expect(&dev, line, want);
            write_pose(line, begin, i, 1, "-1");
            snprintf(want, sizeof want, "ERR -104,\"Data type error; %s: %s is not a number: '1-1'\"", header[c],
                     name[c][i]);
            expect(&dev, line, want);
        }
}

static void an_azimuth_has_six_decimals(void **state)
{
    (void)state;
    static const struct {
        int64_t edge_udeg;
        const char *text;
    } edges[] = {{0, "FREE,0.000000"},
                 {1, "FREE,0.000001"},
                 {999999, "FREE,0.999999"},
                 {90 * MICRO, "FREE,90.000000"},
                 {359999999, "FREE,359.999999"}};
    struct command_device dev = command_test_device();
    expect(&dev, "HEAD:PHASe:EDGE?", "NONE");
    for (size_t i = 0; i < N_OF(edges); i++) {
        dev.phase = (struct command_phase){1, 0, edges[i].edge_udeg};
        expect(&dev, "HEAD:PHASe:EDGE?", edges[i].text);
    }
    dev.phase.is_held = 1;
    expect(&dev, "HEAD:PHASe:EDGE?", "LOCKED,359.999999");
}

/* A number of a pose may have 63 characters: zeros at its beginning, here. */
static void numbers_of_a_pose_have_a_longest_length(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    char line[128];
    dev.step_allowed = dev.pose_allowed = 1;
    dev.pose_reach_m = 100.0;
    snprintf(line, sizeof line, "SITE:POSE %063d,DEF", 2);
    expect(&dev, line, "OK");
    assert_true(result.station == 2 && result.to_first == 1);
    snprintf(line, sizeof line, "SITE:POSE %064d,DEF", 2);
    expect_error(&dev, 1, line, CMD_E_DATA_TYPE, "SITE:POSE: station is not a number: '0000");
    snprintf(line, sizeof line, "SITE:POSE 1,%063d,0,0,0,0,0", 7);
    expect(&dev, line, "OK");
    assert_true(result.place.v[0] == 7.0 && result.to_first == 0);
    snprintf(line, sizeof line, "SITE:POSE 1,%064d,0,0,0,0,0", 7);
    expect(&dev, line, "ERR -222,\"Data out of range; SITE:POSE: x has 64 characters, allowed up to 63\"");
    snprintf(line, sizeof line, "TIME:STEP 1,0,0,0,0,0,%064d", 7);
    expect(&dev, line, "ERR -222,\"Data out of range; TIME:STEP: heading has 64 characters, allowed up to 63\"");
    snprintf(line, sizeof line, "SCAN:REPLay %063d", 0);
    expect(&dev, line, "OK");
    snprintf(line, sizeof line, "SCAN:REPLay 1,%064d", 0);
    expect(&dev, line, "ERR -222,\"Data out of range; SCAN:REPLay: a value has 64 characters, allowed up to 63\"");
}

/* A place is written with the fewest digits that read back as the same number: 1, 15, 16 or 17. */
static void a_place_has_the_fewest_digits(void **state)
{
    (void)state;
    static const struct command_place place = {{0.009, 123456.789012345, 2.0 / 3.0, 0.1 + 0.2, -7, 1e-9}};
    struct command_device dev = command_test_device();
    dev.limits.n_stations = 1;
    dev.place = &place;
    expect(&dev, "SITE:POSE? 1", "0.009,123456.789012345,0.6666666666666666,0.30000000000000004,-7,1e-09");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_number_of_a_pose_has_its_limits),
        cmocka_unit_test(each_number_of_a_pose_has_its_unit),
        cmocka_unit_test(an_azimuth_has_six_decimals),
        cmocka_unit_test(numbers_of_a_pose_have_a_longest_length),
        cmocka_unit_test(a_place_has_the_fewest_digits),
    };
    return cmocka_run_group_tests_name("poses of commands", tests, NULL, NULL);
}
