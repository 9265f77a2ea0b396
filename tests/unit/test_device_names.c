/* SPDX-License-Identifier: MIT */
/* Names of surfaces on the wire. All of them reach a reader that joins late, even names so long that a chunk takes two
 * frames. */
#include "tests/unit/device_rig.h"

enum { OBJECTS = 70, NAME_LEN = 63 };

struct heard {
    int n[OBJECTS];
    int frames;
};

/* Writes separate triangles around the station, with names of 63 bytes, the longest. */
static void write_long_names(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/room.obj", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    for (int i = 0; i < OBJECTS; i++)
        fprintf(f, "o %0*d\nusemtl m%0*d\nv 5 %d 0\nv 5 %d 1\nv 5 %d 0\nf -3 -2 -1\n", NAME_LEN, i, NAME_LEN - 1, i,
                2 * i - 70, 2 * i - 70, 2 * i - 69);
    assert_int_equal(fclose(f), 0);
}

static void take_name(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct heard *heard = ctx;
    assert_true(label < OBJECTS);
    assert_true(strlen(object) == NAME_LEN && strtoul(object, NULL, 10) == label);
    assert_true(material[0] == 'm' && strtoul(material + 1, NULL, 10) == label);
    heard->n[label]++;
}

static void hear(struct rig *rig, struct heard *heard)
{
    const struct ring_tick *tick = rig_fill(rig);
    for (uint32_t at = 0; at < tick->len;) {
        const uint8_t *frame = tick->bytes + at;
        const size_t len = native_frame_len(frame);
        if (frame[1] == NATIVE_SURFACES) {
            const uint8_t *payload = frame + NATIVE_HEADER_LEN;
            assert_int_equal(native_decode_surfaces(payload, len - NATIVE_HEADER_LEN, take_name, heard), 0);
            heard->frames++;
        }
        at += (uint32_t)len;
    }
}

/* 70 names are two chunks: at the scan's start, and then one each quarter of a second. A reader that joins 10 ms after
 * the start has them all within half a second, each once. A chunk of 64 pairs of 128 bytes has 8192 bytes. A frame
 * holds less by its header, so a chunk takes two frames. */
static void all_names_reach_who_joins_late(void **state)
{
    (void)state;
    write_long_names();
    const char *const sets[] = {"head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
    assert_int_equal(write_scene(2), 0);
    assert_int_equal(rig->site->n_surfaces, OBJECTS);
    static struct heard first, late;
    rig_go_to(rig, 230);
    for (int since = 0; since <= 510; since++) {
        assert_true(rig_claim(rig));
        if (since < 10) hear(rig, &first);
        if (since > 10 && rig->work.surfaces_n > 0) hear(rig, &late);
    }
    for (int i = 0; i < OBJECTS; i++)
        if (first.n[i] != 1 || late.n[i] != 1) fail_msg("name %d: %d times, late %d times", i, first.n[i], late.n[i]);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_names_reach_who_joins_late)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
