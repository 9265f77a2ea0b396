/* SPDX-License-Identifier: MIT */
/* A page is told of a head from the watch's opening to its close: the head and its stations, the plan, the scene, and
 * which path leads where. Run from the top of the source tree. */
#include "core/bytes.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "tests/unit/site_rig.h"

#include <ctype.h>
#include <math.h>

static struct site *site;
static struct device *device;
static struct watch *w;

/* A floor below two stations; the first one has a tripod. fixed: the head follows a trajectory, and can't be moved. */
static void open_page(int fixed)
{
    char text[1024], file[160] = "";
    struct watch_options options = {.scene_triangles = WATCH_SCENE_TRIANGLES, .report = &report};
    write_in("floor.obj", "o a \"b\"\nusemtl m\nv -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nf 1 2 3 4\n");
    write_in("ride.csv", "t_s,x_m,y_m,z_m,heading_deg\n0,0,0,2,0\n1,1,0,2,0\n");
    if (fixed)
        snprintf(file, sizeof file, "platform: {kind: trajectory, file: %.*s/ride.csv}\n",
                 (int)(strrchr(config_path, '/') - config_path), config_path);
    snprintf(
        text, sizeof text,
        "head: {profile: sphere, step_deg: 10, serial: S7}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
        "stations:\n  - {name: one, position_m: [0.5, 1, 2], heading_deg: 10, pitch_deg: 2, roll_deg: 3%s}\n%s%s",
        fixed ? "" : ", tripod: {leg_m: 2.5, head_above_m: 0.2, legs_heading_deg: 7}",
        fixed ? "" : "  - {name: two, position_m: [2, 1, 2.5]}\n", file);
    write_in("test.yaml", text);
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    if (device_create(site, &(struct device_options){.report = &report}, &device, &err) != SH_OK)
        fail_msg("%s", err.text);
    options.device = device;
    if (watch_page.open(cfg, site, &options, &w, &err) != SH_OK) fail_msg("%s", err.text);
}

static void close_page(void)
{
    watch_page.close(w);
    device_free(device);
    site_free(site);
}

static struct web_body need_body(const char *at, const char *query)
{
    const struct web_source *source = watch_page.source(w);
    struct web_body body = {0};
    memset(&err, 0, sizeof err);
    if (source->get(source->ctx, at, query, &body, &err) != SH_OK) fail_msg("%s: %s", at, err.text);
    return body;
}

static void give_back(char *bytes)
{
    const struct web_source *source = watch_page.source(w);
    source->release(source->ctx, bytes);
}

/* Takes the number of the run out, which is another one each time: 16 hexadecimal digits. */
static void take_run(char *json)
{
    char *run = strstr(json, "\"run\":\"");
    assert_non_null(run);
    for (int i = 0; i < 16; i++)
        assert_true(isxdigit((unsigned char)run[7 + i]));
    assert_int_equal(run[23], '"');
    memmove(run, run + 25, strlen(run + 25) + 1);
}

/* The tripod's top is 2 - 0.2 = 1.8 m above the floor; its feet are sqrt(2.5^2 - 1.8^2) m from below it. */
static void the_head_and_its_stations(void **state)
{
    (void)state;
    static const char want[] =
        "{\"maker\":\"scanhead\",\"model\":\"sphere\",\"profile\":\"sphere\",\"serial\":\"S7\","
        "\"config\":\"test.yaml\","
        "\"pace\":\"realtime\",\"previews\":true,\"stations\":["
        "{\"number\":1,\"name\":\"one\",\"x_m\":0.5,\"y_m\":1,\"z_m\":2,\"heading_deg\":10,\"pitch_deg\":2,"
        "\"roll_deg\":3,\"tripod\":{\"leg_m\":2.5,\"foot_radius_m\":0,\"height_m\":1.8,\"head_above_m\":0.2,"
        "\"legs_heading_deg\":7},\"served\":true},"
        "{\"number\":2,\"name\":\"two\",\"x_m\":2,\"y_m\":1,\"z_m\":2.5,\"heading_deg\":0,\"pitch_deg\":0,"
        "\"roll_deg\":0,\"tripod\":null,\"served\":true}],\"fields\":[],"
        "\"surfaces\":[{\"label\":0,\"object\":\"a \\\"b\\\"\",\"material\":\"m\"}],"
        "\"bounds\":{\"min\":[-5,-5,0],\"max\":[5,5,0]}}\n";
    open_page(0);
    struct web_body b = need_body("/head", "");
    assert_string_equal(b.type, "application/json");
    take_run(b.bytes);
    /* The radius is a root, so it is compared as a number. */
    char *radius = strstr(b.bytes, "\"foot_radius_m\":");
    assert_non_null(radius);
    assert_true(fabs(atof(radius + 16) - sqrt(2.5 * 2.5 - 1.8 * 1.8)) < 1e-9);
    char *rest = strchr(radius, ',');
    memmove(radius + 17, rest, strlen(rest) + 1);
    radius[16] = '0';
    assert_string_equal(b.bytes, want);
    give_back(b.bytes);
    close_page();
}

/* The points of one run have its number, by which a page knows that a head is another one: 8 bytes after the first 8.
 */
static void a_run_has_one_number(void **state)
{
    (void)state;
    char want[40];
    open_page(0);
    struct web_body past = need_body("/past", ""), head = need_body("/head", "");
    snprintf(want, sizeof want, "{\"run\":\"%016llx\",", (unsigned long long)le_get64((const uint8_t *)past.bytes + 8));
    assert_memory_equal(head.bytes, want, strlen(want));
    give_back(past.bytes);
    give_back(head.bytes);
    close_page();
}

static void paths_lead_to_their_answers(void **state)
{
    static const struct {
        const char *at, *type, *begins;
    } rows[] = {{"/plan", "application/json", "{\"text\":\"sight none; beam single; optics none; georef none\"}\n"},
                {"/quality", "application/json", "{\"scan\":null,\"station\":null,\"over\":false,\"points\":0,"},
                {"/scene", "application/octet-stream", "SHSC"},
                {"/cells", "application/octet-stream", "SHCE"}};
    (void)state;
    open_page(0);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct web_body b = need_body(rows[i].at, "");
        while (b.len == 0) { /* the preview's thread is still making it */
            give_back(b.bytes);
            b = need_body(rows[i].at, "");
        }
        assert_string_equal(b.type, rows[i].type);
        if (b.len < strlen(rows[i].begins) || memcmp(b.bytes, rows[i].begins, strlen(rows[i].begins)) != 0)
            fail_msg("%s: %.*s", rows[i].at, (int)b.len, b.bytes);
        give_back(b.bytes);
    }
    const struct web_source *source = watch_page.source(w);
    struct web_body b;
    memset(&err, 0, sizeof err);
    assert_int_equal(source->get(source->ctx, "/nothing", "", &b, &err), SH_EINPUT);
    assert_string_equal(err.text, ""); /* nothing is there */
    assert_int_equal(source->get(source->ctx, "/saved", "as=xyz", &b, &err), SH_EINPUT);
    close_page();
}

/* A head that moves has no station to be tried elsewhere, and its answers are given back all the same. */
static void without_previews(void **state)
{
    (void)state;
    open_page(1);
    struct web_body b = need_body("/head", "");
    assert_non_null(strstr(b.bytes, "\"previews\":false,"));
    give_back(b.bytes);
    const struct web_source *source = watch_page.source(w);
    memset(&err, 0, sizeof err);
    assert_int_equal(source->get(source->ctx, "/cells", "", &b, &err), SH_EINPUT);
    assert_string_equal(err.text, "");
    close_page();
}

/* The observer ends with the watch, whether its link was given away or not. */
static void an_observer_ends(void **state)
{
    (void)state;
    for (int started = 0; started < 2; started++) {
        open_page(0);
        const struct link_spec *link = started ? watch_page.link(w) : &w->link;
        assert_true(link->fd >= 0 && link->waits == LINK_WAITS_NO);
        const int fd = link->fd;
        if (started) assert_int_equal(watch_page.start(w, &err), SH_OK);
        close_page();
        assert_int_equal(close(fd), started ? 0 : -1); /* it was the watch's own until it was given away */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_head_and_its_stations),
        cmocka_unit_test(a_run_has_one_number),
        cmocka_unit_test(paths_lead_to_their_answers),
        cmocka_unit_test(without_previews),
        cmocka_unit_test(an_observer_ends),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
