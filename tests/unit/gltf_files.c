/* SPDX-License-Identifier: MIT */
#include "tests/unit/gltf_files.h"

#include <math.h>

enum { ROOM = 1 << 18 };

static uint8_t buffer[ROOM];
static char views[ROOM];
static size_t n_bytes, n_views;

void gltf_begin(void)
{
    n_bytes = n_views = 0;
    views[0] = '\0';
}

void gltf_block(const void *data, size_t size, const char *more)
{
    assert_true(n_bytes + size + 4 <= ROOM && n_views + 256 <= ROOM);
    n_views +=
        (size_t)snprintf(views + n_views, ROOM - n_views, "%s{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu%s}",
                         n_views > 0 ? "," : "", n_bytes, size, more);
    memcpy(buffer + n_bytes, data, size);
    n_bytes = (n_bytes + size + 3) & ~(size_t)3;
}

void gltf_quad(void)
{
    static const float p[4][3] = {{-2, -1, -2}, {2, -1, -2}, {2, 1, -2}, {-2, 1, -2}};
    static const float uv[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    static const uint16_t index[6] = {0, 1, 2, 0, 2, 3};
    gltf_begin();
    gltf_block(p, sizeof p, "");
    gltf_block(uv, sizeof uv, "");
    gltf_block(index, sizeof index, "");
}

static size_t put_u32(uint8_t *at, size_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
    return 4;
}

const char *gltf_write(const char *name, const char *rest)
{
    static uint8_t glb[4 * ROOM];
    static char json[2 * ROOM];
    int len = snprintf(json, sizeof json,
                       "{\"asset\":{\"version\":\"2.0\"},\"bufferViews\":[%s],\"buffers\":[{\"byteLength\":%zu}],%s}",
                       views, n_bytes, rest);
    assert_true(len > 0 && (size_t)len + 4 < sizeof json);
    for (; len % 4 != 0; len++)
        json[len] = ' ';
    size_t at = 4;
    memcpy(glb, "glTF", 4);
    at += put_u32(glb + at, 2);
    at += put_u32(glb + at, 28 + (size_t)len + n_bytes);
    at += put_u32(glb + at, (size_t)len);
    memcpy(glb + at, "JSON", 4);
    memcpy(glb + at + 4, json, (size_t)len);
    at += 4 + (size_t)len;
    at += put_u32(glb + at, n_bytes);
    memcpy(glb + at, "BIN", 4);
    memcpy(glb + at + 4, buffer, n_bytes);
    return write_file(name, glb, at + 4 + n_bytes);
}

static int load_it(const char *rest, struct scene **scene, struct sh_err *err)
{
    const struct scene_mesh_spec spec = {.file = gltf_write("a.glb", rest), .scale = 1, .textures = 1, .cutouts = 1};
    int rc = load_spec(&spec, 1e-3, scene, err);
    unlink(path);
    return rc;
}

struct scene *gltf_load(const char *rest)
{
    struct scene *scene;
    struct sh_err err;
    if (load_it(rest, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

void gltf_refuse(const char *rest, const char *expected)
{
    struct scene *scene;
    struct sh_err err = {0};
    assert_int_equal(load_it(rest, &scene, &err), SH_EINPUT);
    if (strstr(err.text, expected) == NULL || strstr(err.text, "a.glb") == NULL || strchr(err.text, '\n') != NULL)
        fail_msg("%s", err.text);
}

void gltf_check_box(const struct scene *s, const double low[3], const double high[3], double within)
{
    for (int k = 0; k < 3; k++)
        if (!(fabs(s->min_m[k] - low[k]) <= within && fabs(s->max_m[k] - high[k]) <= within))
            fail_msg("axis %d: %.9g to %.9g, not %.9g to %.9g", k, s->min_m[k], s->max_m[k], low[k], high[k]);
}
