/* SPDX-License-Identifier: MIT */
/* map --perspective gives the same picture of a scan, of its recording, and of the recording brought back from another
 * CRS. */
#include "tests/wire/room.h"

#include <png.h>

struct picture {
    uint32_t width, height;
    uint8_t *rgb;
};

static struct picture load(struct wire *wire, const char *name)
{
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, wire_path(wire, name)));
    image.format = PNG_FORMAT_RGB;
    struct picture p = {image.width, image.height, malloc(PNG_IMAGE_SIZE(image))};
    assert_true(png_image_finish_read(&image, NULL, p.rgb, 0, NULL));
    return p;
}

/* Counts the pixels that differ by more than `most` in a channel. */
static uint32_t differences(const struct picture *a, const struct picture *b, int most)
{
    uint32_t n = 0;
    assert_true(a->width == b->width && a->height == b->height);
    for (size_t i = 0; i < (size_t)a->width * a->height; i++) {
        int worst = 0;
        for (size_t k = 0; k < 3; k++)
            worst =
                abs(a->rgb[3 * i + k] - b->rgb[3 * i + k]) > worst ? abs(a->rgb[3 * i + k] - b->rgb[3 * i + k]) : worst;
        n += worst > most;
    }
    return n;
}

static struct picture view(struct wire *wire, const char *from, const char *cloud, const char *colour)
{
    char in[352], out[352], with[352] = "";
    snprintf(in, sizeof in, "%s", wire_path(wire, from));
    snprintf(out, sizeof out, "%s", wire_path(wire, "view.png"));
    if (cloud != NULL) snprintf(with, sizeof with, "%s", wire_path(wire, cloud));
    const char *const args[] = {"map",
                                in,
                                "--perspective",
                                "-o",
                                out,
                                "--size",
                                "300x200",
                                "--eye",
                                "-9,-14,16",
                                "--look-at",
                                "0,0,0",
                                "--below",
                                "1.5",
                                "--colour",
                                colour,
                                "--quiet",
                                cloud != NULL ? "--cloud" : NULL,
                                with,
                                NULL};
    wire_run(wire, args, 0);
    struct picture p = load(wire, "view.png");
    assert_true(p.width == 300 && p.height == 200);
    return p;
}

static void record(struct wire *wire, const char *out)
{
    char config[352], to[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(to, sizeof to, "%s", wire_path(wire, out));
    const char *const args[] = {"record", config, "-o", to, "--quiet", NULL};
    wire_run(wire, args, 0);
}

static void write_room(struct wire *wire, const char *output)
{
    struct room_config c = {.prr_hz = 50000,
                            .lines_hz = 50,
                            .pan_deg_s = 120,
                            .pan_stop_deg = 350,
                            .frames = 1,
                            .links = "links: [{type: \"null\"}]\n",
                            .more = output};
    room_write(wire);
    room_config_write(wire, &c);
}

static void test_same_picture(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "output: {layout: geo, colour: label}\n");
    record(wire, "local.ply");
    static const char *const colours[] = {"height", "label", "range", "rgb"};
    struct picture scans[4];
    for (int i = 0; i < 4; i++) {
        scans[i] = view(wire, "config.yaml", NULL, colours[i]);
        struct picture cloud = view(wire, "config.yaml", "local.ply", colours[i]);
        assert_int_equal(differences(&scans[i], &cloud, 0), 0); /* the same points */
        free(cloud.rgb);
    }
    for (int i = 0; i < 3; i++)
        assert_true(differences(&scans[i], &scans[i + 1], 30) > 5000);
    /* Without a configuration the picture has neither the station's mark nor its name. */
    struct picture alone = view(wire, "local.ply", NULL, "height");
    const uint32_t mark = differences(&scans[0], &alone, 0);
    assert_true(mark > 0 && mark < 3000);
    free(alone.rgb);
    for (int i = 0; i < 4; i++)
        free(scans[i].rgb);
}

/* From UTM, turned and scaled, the points come back to the scene to a micrometre. A micrometre moves hardly a point
 * into another pixel. */
static void test_other_crs(void **state)
{
    struct wire *wire = *state;
    write_room(wire, "output: {crs: utm, layout: geo}\n");
    char *text = wire_read(wire_path(wire, "config.yaml"), NULL), *at = strstr(text, "stations:"), *all = NULL;
    assert_non_null(at);
    assert_true(
        asprintf(&all,
                 "%.*s  anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 48, lon_deg: 11, height_m: 500, "
                 "north_deg: 30}\n%s",
                 (int)(at - text), text, at) > 0);
    wire_write_text(wire, "config.yaml", all);
    free(all);
    free(text);
    record(wire, "utm.ply");
    struct picture scan = view(wire, "config.yaml", NULL, "label"),
                   cloud = view(wire, "config.yaml", "utm.ply", "label");
    assert_true(differences(&scan, &cloud, 12) < 300); /* of 60000 */
    free(scan.rgb);
    free(cloud.rgb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_picture, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_other_crs, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
