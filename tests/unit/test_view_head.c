/* SPDX-License-Identifier: MIT */
/* The description of a recording that `scanhead view` serves: each key has the figure that README.md gives it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/view/encode.h"

/* No two figures are the same, so exchanged ones show. */
static const struct viewed_mesh MESHES[] = {
    {.station = 3,
     .scan = 4,
     .sweep = 5,
     .first_point = 6,
     .n_points = 7,
     .n_faces = 8,
     .mean_edge_m = 0.5,
     .n_edges = 9,
     .n_flat = 10},
    {.station = 13,
     .scan = 14,
     .sweep = 15,
     .first_point = 16,
     .n_points = 17,
     .n_faces = 18,
     .mean_edge_m = 1.5,
     .n_edges = 19,
     .n_flat = 20},
};

static void expect_in_order(const struct viewed *v, const char *const *parts)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(page_json(view_put_head, v, &body, &err), 0);
    const char *at = body.bytes;
    for (; *parts != NULL; parts++) {
        if (strncmp(at, *parts, strlen(*parts)) != 0) fail_msg("not %s but %s", *parts, at);
        at += strlen(*parts);
    }
    assert_string_equal(at, "\n");
    free(body.bytes);
}

static void each_key_of_a_turned_recording(void **state)
{
    uint8_t echo[2] = {1, 2};
    uint16_t label[2] = {3, 4};
    struct viewed_station station[2] = {{.number = 3}, {3 + 1, 1, {1.5, 2.5, 3.5}, M_PI, -M_PI / 2, M_PI / 4}};
    struct viewed_surface surface[2] = {{3, (char *)"wall", (char *)"lime"}, {4, (char *)"floor", (char *)""}};
    struct viewed v = {.path = "folder/some.shs",
                       .format = "shs",
                       .points = {.n = 2, .echo = echo, .label = label, .epsg = 4978},
                       .n_empty = 21,
                       .n_left_out = 22,
                       .complete = 1,
                       .turned = 1,
                       .lat_deg = 52.5,
                       .lon_deg = 13.25,
                       .height_m = 100.125,
                       .mesh = (struct viewed_mesh *)MESHES,
                       .n_meshes = 2,
                       .station = station,
                       .n_stations = 2,
                       .surface = surface,
                       .n_surfaces = 2,
                       .idn = "Maker,Model,17,4.5",
                       .profile = "full-sweep",
                       .min_m = {-1, -2, -3},
                       .max_m = {4, 5, 6},
                       .origin_m = {7, 8, 9},
                       .t0_s = 10.5};
    (void)state;
    v.low[CLOUD_LABEL] = 3;
    v.high[CLOUD_LABEL] = 4;
    v.low[CLOUD_ECHO] = 1;
    v.high[CLOUD_ECHO] = 2;
    expect_in_order(
        &v,
        (const char *const[]){
            "{\"recording\":{\"file\":\"some.shs\",\"format\":\"shs\",\"frame\":\"enu\",\"crs\":\"EPSG:4978\",",
            "\"place\":{\"lat_deg\":52.5,\"lon_deg\":13.25,\"height_m\":100.125},",
            "\"points\":2,\"shots_without_echo\":21,\"left_out\":22,\"complete\":true,\"t0_s\":10.5,",
            "\"columns\":[{\"name\":\"xyz\",\"type\":\"float32\",\"components\":3,\"unit\":\"m\",\"min\":null,"
            "\"max\":null},",
            "{\"name\":\"label\",\"type\":\"uint16\",\"components\":1,\"unit\":null,\"min\":3,\"max\":4},",
            "{\"name\":\"echo\",\"type\":\"uint8\",\"components\":1,\"unit\":null,\"min\":1,\"max\":2}],",
            "\"limits\":{\"points_per_answer\":1048576,\"triangles_per_answer\":1048576,\"sparse_points\":4000000},",
            "\"has_mesh\":true,\"why_no_mesh\":null,\"meshes\":[",
            "{\"scan\":1,\"station\":3,\"station_scan\":4,\"sweep\":5,\"first_point\":6,\"points\":7,\"triangles\":8,"
            "\"edges\":9,\"mean_edge_m\":0.5,\"flat\":10},",
            "{\"scan\":2,\"station\":13,\"station_scan\":14,\"sweep\":15,\"first_point\":16,\"points\":17,"
            "\"triangles\":18,\"edges\":19,\"mean_edge_m\":1.5,\"flat\":20}]},",
            "\"maker\":\"Maker\",\"model\":\"Model\",\"serial\":\"17\",\"profile\":\"full-sweep\",\"config\":null,",
            "\"stations\":[{\"number\":3,\"name\":null,\"x_m\":null,\"y_m\":null,\"z_m\":null,\"heading_deg\":null,"
            "\"pitch_deg\":null,\"roll_deg\":null,\"tripod\":null,\"served\":true},",
            "{\"number\":4,\"name\":null,\"x_m\":1.5,\"y_m\":2.5,\"z_m\":3.5,\"heading_deg\":180,\"pitch_deg\":-90,"
            "\"roll_deg\":45,\"tripod\":null,\"served\":true}],",
            "\"surfaces\":[{\"label\":3,\"object\":\"wall\",\"material\":\"lime\"},",
            "{\"label\":4,\"object\":\"floor\",\"material\":\"\"}],",
            "\"bounds\":{\"min\":[-1,-2,-3],\"max\":[4,5,6]},\"origin\":[7,8,9]}", NULL});
}

/* A file that says nothing of itself: nothing is made up. */
static void frames_and_unknown_heads(void **state)
{
    static const struct {
        int64_t epsg;
        const char *frame;
    } row[] = {{0, "\"scene\""}, {1, "\"EPSG:1\""}, {32633, "\"EPSG:32633\""}, {-1, "\"unknown\""}};
    (void)state;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char frame[128];
        struct viewed v = {
            .path = "a.ply", .format = "ply", .points.epsg = row[i].epsg, .idn = "Maker,,7", .why_no_mesh = "no rows"};
        snprintf(frame, sizeof frame, "{\"recording\":{\"file\":\"a.ply\",\"format\":\"ply\",\"frame\":%s,",
                 row[i].frame);
        expect_in_order(
            &v,
            (const char *const[]){
                frame, "\"crs\":null,\"place\":null,\"points\":0,\"shots_without_echo\":0,\"left_out\":0,",
                "\"complete\":false,\"t0_s\":0,\"columns\":[{\"name\":\"xyz\",\"type\":\"float32\",\"components\":3,"
                "\"unit\":\"m\",\"min\":null,\"max\":null}],\"limits\":{\"points_per_answer\":1048576,",
                "\"triangles_per_answer\":1048576,\"sparse_points\":4000000},",
                "\"has_mesh\":false,\"why_no_mesh\":\"no rows\",\"meshes\":[]},",
                "\"maker\":\"Maker\",\"model\":null,\"serial\":\"7\",\"profile\":null,\"config\":null,\"stations\":[],",
                "\"surfaces\":[],\"bounds\":{\"min\":[0,0,0],\"max\":[0,0,0]},\"origin\":[0,0,0]}", NULL});
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_key_of_a_turned_recording),
                                       cmocka_unit_test(frames_and_unknown_heads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
