/* SPDX-License-Identifier: MIT */
/* Frames of lost ticks are sent again: descriptor and anchor, on a drive along which the anchor changes. */
#include "tests/unit/device_rig.h"

static const char DRIVE[] = "x_m,y_m,z_m,speed_m_s\n0,0,0,900\n0,9000,0,900\n";

/* A scan on a drive of 10 s; each stretch takes 2.2 s. */
static struct rig *drive(char path[96])
{
    char way[128];
    snprintf(path, 96, "%s/way.csv", folder);
    snprintf(way, sizeof way, "platform.waypoints=%s", path);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(DRIVE, f);
    assert_int_equal(fclose(f), 0);
    const char *const sets[] = {"platform.kind=trajectory",
                                way,
                                "stations[1].name=b",
                                "head.frames=0",
                                "head.prr_hz=10000",
                                "scene.anchor.source=explicit",
                                "scene.anchor.lat_deg=52",
                                "scene.anchor.lon_deg=13",
                                "scene.anchor.height_m=80",
                                "output.layout=geo",
                                "output.crs=utm"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 11);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    return rig;
}

static size_t stretch_after(const struct rig *rig)
{
    return site_stretch_at(rig->site, schedule_time_ns(&rig->work.segment, rig->work.pulse_end - 1));
}

/* Claims until the tick with a new anchor. */
static void go_to_new_anchor(struct rig *rig)
{
    for (int i = 0; i < 4000; i++) {
        assert_true(rig_claim(rig) && rig->work.scanning);
        if (stretch_after(rig) != rig->work.stretch) return;
    }
    fail_msg("no new anchor");
}

static void expect_anchor(const struct rig *rig)
{
    struct native_anchor anchor;
    device_fill_anchor(rig->site, rig->work.station, rig->work.stretch, &anchor);
    assert_true(rig->work.describe && rig->work.describe_flags == NATIVE_REPEAT);
    assert_memory_equal(rig->work.anchor.anchor, anchor.anchor, sizeof anchor.anchor);
}

static void an_anchor_lost_with_its_tick_comes_with_the_next(void **state)
{
    (void)state;
    char path[96];
    struct rig *rig = drive(path);
    go_to_new_anchor(rig);
    assert_false(rig->work.describe);
    device_lost(rig->device, &rig->work);
    assert_true(rig_claim(rig));
    expect_anchor(rig);
    assert_true(rig_claim(rig) && !rig->work.describe); /* once is enough */
    rig_close(rig);
    unlink(path);
}

/* When the anchor's tick is lost, the ticks after it are claimed already. */
static void an_anchor_lost_late_comes_late(void **state)
{
    (void)state;
    char path[96];
    struct rig *rig = drive(path);
    go_to_new_anchor(rig);
    struct device_work lost = rig->work;
    for (int i = 0; i < 20; i++)
        assert_true(rig_claim(rig) && !rig->work.describe);
    device_lost(rig->device, &lost);
    assert_true(rig_claim(rig));
    expect_anchor(rig);
    rig_close(rig);
    unlink(path);
}

/* The tick that repeats the anchor may be lost, too. */
static void an_anchor_lost_again_comes_again(void **state)
{
    (void)state;
    char path[96];
    struct rig *rig = drive(path);
    go_to_new_anchor(rig);
    device_lost(rig->device, &rig->work);
    for (int i = 0; i < 5; i++) {
        assert_true(rig_claim(rig));
        expect_anchor(rig);
        device_lost(rig->device, &rig->work);
    }
    assert_true(rig_claim(rig));
    expect_anchor(rig);
    assert_true(rig_claim(rig) && !rig->work.describe);
    rig_close(rig);
    unlink(path);
}

static void a_tick_without_an_anchor_says_none_again(void **state)
{
    (void)state;
    char path[96];
    struct rig *rig = drive(path);
    rig_go_to(rig, rig->next + 20);
    for (int i = 0; i < 5; i++) {
        assert_true(rig->work.scanning && !rig->work.describe);
        device_lost(rig->device, &rig->work);
        assert_true(rig_claim(rig));
    }
    rig_close(rig);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_anchor_lost_with_its_tick_comes_with_the_next),
        cmocka_unit_test(an_anchor_lost_late_comes_late),
        cmocka_unit_test(an_anchor_lost_again_comes_again),
        cmocka_unit_test(a_tick_without_an_anchor_says_none_again),
    };
    return cmocka_run_group_tests_name("lost anchors", tests, make_folder, remove_folder);
}
