/* SPDX-License-Identifier: MIT */
/* Faults that change the measurements. Heads that can't have them get the reason. */
#include "tests/unit/config_rig.h"

/* Loads another head, or any-rate, with a list of faults. says: the end of the error. */
static void assert_refused(const char *profile, const char *rest, const char *item, const char *says)
{
    char with[512];
    const size_t end = says != NULL ? strlen(says) : 0;
    snprintf(with, sizeof with, "%sfaults: [%s]\n", rest, item);
    load_with_head(profile != NULL ? profile : "any-rate", "", with);
    const size_t len = strlen(err.text);
    if (says == NULL ? err.code != SH_OK
                     : err.code != SH_EINPUT || len < end || strcmp(err.text + len - end, says) != 0)
        fail_msg("%s, %s: \"%s\", expected \"%s\"", profile != NULL ? profile : "any-rate", item, err.text,
                 says != NULL ? says : "nothing");
}

#define NO_EFFECT                                                                                                \
    ": faults[0].kind: window_soiled would have no effect: no signal is modelled, ranges have no noise, and no " \
    "link speaks cola; allowed with signal.model: on, or noise.range: on and noise.sigma_m above 0, or "         \
    "links[].protocol: cola"
#define AT_STEPS \
    ", but head profile hokuyo-utm-30lx (planar) fires at steps of its mirror; allowed with line, beams, or mirror_slow"
#define NO_MIRROR ", but head profile sphere (sphere) has no mirror; allowed with line, "

static void a_head_has_faults_of_what_it_has(void **state)
{
    (void)state;
    static const struct {
        const char *profile, *rest, *item, *says; /* says NULL: it is taken */
    } cases[] = {
        {NULL, "", "{kind: mirror_slow, factor: 0.1}", NULL},
        {NULL, "", "{kind: mirror_stuck}, {kind: mirror_wobble}, {kind: pan_slip}, {kind: laser_off}", NULL},
        {"hokuyo-utm-30lx", "", "{kind: mirror_slow, factor: 2}",
         ": faults[0].factor: 2 times 40 lines per second are more than head profile hokuyo-utm-30lx can have; "
         "allowed below 1"},
        {"hokuyo-ust-10lx", "", "{kind: mirror_slow, factor: 1}",
         ": faults[0].factor: mirror_slow would have no effect with 1; allowed are other values"},
        {NULL, "", "{kind: window_soiled}", NO_EFFECT},
        {NULL, "noise: {range: on, sigma_m: 0}\n", "{kind: window_soiled}", NO_EFFECT},
        {NULL, "noise: {range: on}\n", "{kind: window_soiled}", NULL},
        {NULL, "signal: {model: on}\n", "{kind: window_soiled}", NULL},
        {"hokuyo-utm-30lx", "", "{kind: mirror_slow}, {kind: pan_slip}, {kind: laser_off}", NULL},
        {"hokuyo-utm-30lx", "", "{kind: mirror_stuck}", ": faults[0].kind: mirror_stuck" AT_STEPS},
        {"hokuyo-utm-30lx", "", "{kind: mirror_wobble}", ": faults[0].kind: mirror_wobble" AT_STEPS},
        {"hokuyo-utm-30lx", "platform: {kind: live}\n", "{kind: mirror_slow}",
         ": faults[0].kind: mirror_slow, but head profile hokuyo-utm-30lx (planar) is on a live platform; "
         "allowed with platform.kind static, trajectory or stops"},
        {"velodyne-vlp16", "", "{kind: mirror_slow}, {kind: mirror_stuck}, {kind: mirror_wobble}", NULL},
        {"sphere", "", "{kind: mirror_slow}", ": faults[0].kind: mirror_slow" NO_MIRROR "planar, beams"},
        {"sphere", "", "{kind: mirror_stuck}", ": faults[0].kind: mirror_stuck" NO_MIRROR "beams"},
        {"sphere", "", "{kind: mirror_wobble}", ": faults[0].kind: mirror_wobble" NO_MIRROR "beams"},
        {"sphere", "", "{kind: laser_off}, {kind: mirror_stuck}", ": faults[1].kind: mirror_stuck" NO_MIRROR "beams"},
        {"sphere", "", "{kind: laser_off}, {kind: pan_slip}", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        assert_refused(cases[i].profile, cases[i].rest, cases[i].item, cases[i].says);
}

/* Without noise and signal LCMstate alone follows the window. */
static void a_client_of_cola_is_told_of_a_soiled_window(void **state)
{
    (void)state;
    const char *const sets[] = {"links=[{type: tcp, protocol: cola}]"};
    assert_refused("sick-tim781", "", "{kind: window_soiled}", NO_EFFECT);
    load_sets(sets, 1);
    assert_loads(err.code);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_head_has_faults_of_what_it_has),
                                       cmocka_unit_test(a_client_of_cola_is_told_of_a_soiled_window)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
