/* SPDX-License-Identifier: MIT */
/* A page saves the points so far while frames were lost, go missing, or are still to come. Run from the top of the
 * source tree. */
#include <dlfcn.h>
#include <stdlib.h>

#include "drivers/protocol/native_encode.h"
#include "tests/unit/save_rig.h"

static int n_behind; /* so often the observer is asked before it has read a scan's end */
static struct scanhead *rest;
static struct sh_err err;
static struct past *growing; /* it takes more frames once a whole piece of it is written; NULL: none does */
static uint64_t n_taken;     /* points */

/* Takes the frames of `rest` until so many points have come in all. */
static void take_points(struct past *to, uint64_t in_all)
{
    struct scanhead_frame frame;
    while (n_taken < in_all) {
        assert_int_equal(scanhead_next(rest, &frame, -1), 0);
        past_take(to, &frame);
        if (frame.type == SCANHEAD_POINTS) n_taken += frame.n_points;
    }
}

/* The product's call comes here, between two pieces of the past. */
size_t fwrite(const void *from, size_t size, size_t n, FILE *f)
{
    size_t (*real)(const void *, size_t, size_t, FILE *);
    void *found = dlsym(RTLD_NEXT, "fwrite");
    memcpy(&real, &found, sizeof real);
    if (n >= PAST_PIECE && growing != NULL) {
        take_points(growing, 130000);
        growing = NULL;
    }
    return real(from, size, n, f);
}

static struct scanhead *open_frames(struct past **to)
{
    struct scanhead *sh;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    *to = past_create(&limits);
    assert_non_null(*to);
    assert_int_equal(scanhead_open("s.shs", &sh, NULL, 0), 0);
    return sh;
}

static char *saved_ply(const struct save_source *source, size_t *len)
{
    save_free(save_rig);
    save_rig = save_create(source);
    assert_non_null(save_rig);
    save_rig_make_ply();
    return save_rig_fetch(1, len);
}

/* Frames that the observer lost are missing in the file, and its header counts them, and no others. The end of the
 * first scan is among them. */
static void lost_frames_are_counted(void **state)
{
    (void)state;
    uint8_t raw[512];
    size_t len;
    struct past *part;
    struct scanhead_frame frame;
    struct scanhead *sh = open_frames(&part);
    const struct native_event event = {.code = NATIVE_EV_READER_LOST, .a = 653, .c = 653};
    const struct scanhead_frame lost = {
        .type = SCANHEAD_EVENT,
        .flags = SCANHEAD_LOCAL,
        .event = SCANHEAD_EV_READER_LOST,
        .event_value = {653, 0, 653},
        .raw = raw,
        .raw_len = native_encode_event(raw, sizeof raw, &event, 0, NATIVE_LOCAL),
    };
    assert_int_equal(save_rig_take(part, sh, 4), 1);
    do
        assert_int_equal(scanhead_next(sh, &frame, -1), 0);
    while (frame.type != SCANHEAD_EVENT || frame.event != SCANHEAD_EV_SCAN_END);
    past_take(part, &lost);
    assert_int_equal(save_rig_take(part, sh, UINT32_MAX), 0);
    scanhead_close(sh);
    char *got = saved_ply(&(struct save_source){.past = part}, &len);
    has(got, "comment frames_lost 653 reader_lost 653 ");
    struct web_body body;
    assert_int_equal(save_get(save_rig, "as=obj", &body, &err), SH_EINPUT);
    assert_int_equal(save_get(save_rig, "", &body, &err), SH_OK); /* a wrong question does not undo the file */
    has(body.bytes, "\"state\":\"done\"");
    has(body.bytes, "\"lost_frames\":653}");
    free(body.bytes);
    free(got);
    save_rig_close(state);
    past_free(part);
}

/* The observer reads the rest of the scan while the thread waits. */
static int is_behind(void *ctx)
{
    if (--n_behind > 0) return 1;
    assert_int_equal(save_rig_take(ctx, rest, UINT32_MAX), 0);
    return 0;
}

static void the_end_of_a_scan_is_waited_for(void **state)
{
    (void)state;
    size_t len;
    struct past *part;
    rest = open_frames(&part);
    assert_int_equal(save_rig_take(part, rest, 4), 1);
    n_behind = 3;
    char *got = saved_ply(&(struct save_source){part, is_behind, part}, &len);
    assert_int_equal(n_behind, 0);
    save_rig_same_points(got, len);
    free(got);
    save_rig_close(state);
    scanhead_close(rest);
    past_free(part);
}

/* A piece of at least 1 MiB has 52,000 points of 20 bytes. When the first one is written, more points come, and the
 * first and the second go. So the file has the first and the third. All shots meet a wall, so a PLY has all points. */
static void points_that_go_meanwhile_are_counted(void **state)
{
    (void)state;
    char head[2048] = "", want[64];
    unsigned n_points = 0;
    struct web_body body;
    struct past *part = past_create(&(struct past_limits){70000, PAST_MOST_BYTES});
    assert_non_null(part);
    write_text("room.obj", "o room\nv -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nv -5 -5 4\nv 5 -5 4\nv 5 5 4\nv -5 5 4\n"
                           "f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n");
    write_text("room.yaml",
               "head: {profile: sphere, step_deg: 0.6}\noutput: {crs: local}\n"
               "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 2]}]\n");
    does(&app_record, "room.yaml -o room.shs --quiet", 0);
    assert_int_equal(scanhead_open("room.shs", &rest, NULL, 0), 0);
    take_points(part, 60000);
    growing = part;
    save_free(save_rig);
    save_rig = save_create(&(struct save_source){.past = part});
    save_rig_make_ply();
    assert_null(growing);
    assert_int_equal(save_get_piece(save_rig, "file=1", &body, &err), SH_OK);
    memcpy(head, body.bytes, sizeof head - 1);
    free(body.bytes);
    has(head, "comment frames_lost 1 reader_lost 0 ");
    assert_int_equal(sscanf(strstr(head, "element vertex"), "element vertex %u", &n_points), 1);
    assert_in_range(n_points, 60000, 90000);
    snprintf(want, sizeof want, "\"gone\":%u,\"lost_frames\":0}", (unsigned)n_taken - n_points);
    assert_int_equal(save_get(save_rig, "", &body, &err), SH_OK);
    has(body.bytes, want);
    free(body.bytes);
    save_rig_close(state);
    scanhead_close(rest);
    past_free(part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(lost_frames_are_counted, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(the_end_of_a_scan_is_waited_for, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(points_that_go_meanwhile_are_counted, save_rig_open, save_rig_close),
    };
    return cmocka_run_group_tests(tests, save_rig_begin, save_rig_end);
}
