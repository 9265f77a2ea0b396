/* SPDX-License-Identifier: MIT */
/* Copies of meshes keep their texture coordinates, colours and holes, beside meshes with and without any; also when
 * they are written out. */
#include <math.h>
#include <png.h>

#include "core/scene_copies.h"
#include "tests/unit/scene_files.h"

enum { MOST = 16 };

/* The left texel of the image is a hole. */
static int make_files(void **state)
{
    static const uint8_t rgba[2][4] = {{9, 9, 9, 0}, {9, 9, 9, 255}};
    png_image image = {.version = PNG_IMAGE_VERSION, .width = 2, .height = 1, .format = PNG_FORMAT_RGBA};
    if (make_folder(state) != 0) return -1;
    write_text("t.mtl", "newmtl leaf\nmap_Kd t.png\n");
    write_text("t.obj",
               "mtllib t.mtl\no stem\nv 0 0 0 0.2 0 0\nv 1 0 0 0 0.4 0\nv 0 1 0 0 0 0.6\nf 1 2 3\no leaf\nusemtl leaf\n"
               "vt 0 0\nvt 1 0\nvt 0.25 0.75\nf 1/1 2/2 3/3\n");
    write_text("p.obj", "o post\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no rail\nf 3 2 1\n");
    write_text("t.png", "");
    return png_image_write_to_file(&image, path, 0, rgba, 0, NULL) ? 0 : -1;
}

static int remove_files(void **state)
{
    static const char *const file[] = {"t.mtl", "t.obj", "p.obj", "t.png"};
    for (int i = 0; i < 4; i++)
        unlink(path_in(file[i]));
    return remove_folder(state);
}

/* These figures of a triangle are those of its file, whichever scene holds it. */
struct shown {
    float uv[3][2];
    uint8_t rgb[3][4];
    int texture, hole[2];
};

static void look(const struct scene *s, struct shown *out)
{
    assert_true(s->n_all <= MOST);
    for (uint32_t i = 0; i < s->n_all; i++) {
        static const double left[2] = {0.25, 0.5}, right[2] = {0.75, 0.5};
        struct scene_part part;
        scene_find_part(s, i, &part);
        const struct scene *of = part.scene;
        memset(&out[i], 0, sizeof out[i]);
        for (int k = 0; k < 6; k++)
            out[i].uv[k / 2][k % 2] = of->uv != NULL && !isnan(of->uv[part.triangle][k / 2][k % 2])
                                          ? of->uv[part.triangle][k / 2][k % 2]
                                          : -1;
        if (of->rgb != NULL) memcpy(out[i].rgb, of->rgb[part.triangle], sizeof out[i].rgb);
        const uint16_t texture = s->surface[scene_label(s, i)].texture;
        assert_true(texture <= s->n_textures);
        out[i].texture = texture > 0 && strstr(s->texture[texture - 1].file, "t.png") != NULL;
        const struct texture_mask *mask = of->cutout != NULL ? scene_cutout(of, part.triangle) : NULL;
        out[i].hole[0] = mask != NULL && texture_is_hole(mask, left);
        out[i].hole[1] = mask != NULL && texture_is_hole(mask, right);
    }
}

/* The two triangles of each file, as they were written: 0.2 is 51 of 255. */
static void expect(const struct shown *got, int textured)
{
    static const struct shown
        plain = {.uv = {{-1, -1}, {-1, -1}, {-1, -1}}},
        stem = {{{-1, -1}, {-1, -1}, {-1, -1}}, {{51, 0, 0, 255}, {0, 102, 0, 255}, {0, 0, 153, 255}}, 0, {0, 0}},
        leaf = {{{0, 0}, {1, 0}, {0.25f, 0.75f}}, {{51, 0, 0, 255}, {0, 102, 0, 255}, {0, 0, 153, 255}}, 1, {1, 0}};
    assert_memory_equal(&got[0], textured ? &stem : &plain, sizeof plain);
    assert_memory_equal(&got[1], textured ? &leaf : &plain, sizeof plain);
}

static void copies_look_as_their_mesh(void **state)
{
    (void)state;
    static struct scene_place place[2] = {{.at_m = {5, 0, 0}, .scale = 1}, {.at_m = {0, 5, 0}, .scale = 2}};
    for (int textured = 0; textured < 4; textured++)
        for (int own = 0; own < 2; own++) {
            struct shown shown[MOST];
            struct scene *s;
            struct sh_err err;
            char file[2][128];
            for (int k = 0; k < 2; k++)
                snprintf(file[k], sizeof file[k], "%s", path_in(textured >> k & 1 ? "t.obj" : "p.obj"));
            const struct scene_mesh_spec spec[2] = {
                {.file = file[0], .scale = 1, .textures = 1, .cutouts = 1},
                {.file = file[1], .scale = 1, .textures = 1, .cutouts = 1, .places = {place, 2, own, "places"}}};
            if (scene_load(spec, 2, 1e-3, NULL, &s, &err) != SH_OK) fail_msg("%s", err.text);
            assert_int_equal(s->n_all, 6);
            for (uint32_t l = 2; l < s->n_surfaces; l++) { /* of copies; their mesh has the holes */
                assert_int_equal(s->surface[l].texture, l % 2 == 1 && textured >> 1 ? 1 + (textured & 1) : 0);
                assert_true(s->cutout == NULL || s->cutout[l] == NULL);
            }
            for (int written_out = 0; written_out < 2; written_out++) {
                look(s, shown);
                for (int k = 0; k < 3; k++)
                    expect(shown + 2 * k, textured >> (k > 0) & 1);
                if (!written_out) assert_int_equal(scene_write_out_copies(s, 6, NULL, &err), SH_OK);
            }
            scene_free(s);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(copies_look_as_their_mesh)};
    return cmocka_run_group_tests_name("copies_textures", tests, make_files, remove_files);
}
