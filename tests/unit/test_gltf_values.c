/* SPDX-License-Identifier: MIT */
/* Numbers of accessors by the table of glTF 2.0 (3.11, "Animations": normalized integers), matrices of nodes, and
 * packed buffers by EXT_meshopt_compression. */
#include <math.h>
#include <meshoptimizer.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/import/gltf/gltf_accessor.h"
#include "core/import/gltf/gltf_matrix.h"
#include "core/import/gltf/gltf_meshopt.h"
#include "core/scene/build.h"
#include "tests/common/cases.h"

/* Bytes of elements lie in two components each, little-endian, with a gap after each element. */
static void numbers_of_each_type(void **state)
{
    (void)state;
    static const struct {
        enum gltf_component component;
        size_t size;
        uint64_t bits[4];
        double plain[4], normalized[4], step;
    } rows[] = {
        {GLTF_I8, 1, {0x80, 0x81, 0, 0x7f}, {-128, -127, 0, 127}, {-1, -1, 0, 1}, 1 / 127.0},
        {GLTF_U8, 1, {0, 51, 128, 255}, {0, 51, 128, 255}, {0, 0.2, 128 / 255.0, 1}, 1 / 255.0},
        {GLTF_I16, 2, {0x8000, 0x8001, 1, 0x7fff}, {-32768, -32767, 1, 32767}, {-1, -1, 1 / 32767.0, 1}, 1 / 32767.0},
        {GLTF_U16, 2, {0, 13107, 0x8000, 0xffff}, {0, 13107, 32768, 65535}, {0, 0.2, 32768 / 65535.0, 1}, 1 / 65535.0},
        {GLTF_U32,
         4,
         {0, 858993459, 1, 0xffffffff},
         {0, 858993459, 1, 4294967295},
         {0, 0.2, 1 / 4294967295.0, 1},
         1 / 4294967295.0},
        {GLTF_F32, 4, {0x3f800000, 0xbf000000, 0, 0x42280000}, {1, -0.5, 0, 42}, {1, -0.5, 0, 42}, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t data[40];
        struct gltf_view v = {.data = data,
                              .stride = 2 * rows[i].size + 3,
                              .count = 2,
                              .n_components = 2,
                              .component = rows[i].component};
        memset(data, 0xee, sizeof data);
        for (size_t k = 0; k < 4; k++)
            memcpy(data + k / 2 * v.stride + k % 2 * rows[i].size, &rows[i].bits[k], rows[i].size);
        for (int normalized = 0; normalized < 2; normalized++) {
            v.is_normalized = normalized;
            for (uint32_t k = 0; k < 4; k++) {
                const double want = (normalized ? rows[i].normalized : rows[i].plain)[k],
                             got = gltf_value(&v, k / 2, k % 2);
                if (!(fabs(got - want) < 1e-15)) fail_msg("%zu, %d, %u: %.17g, not %.17g", i, normalized, k, got, want);
            }
            assert_true(gltf_step(&v) == (normalized || rows[i].step == 0 ? rows[i].step : 1));
        }
        v.data = NULL;
        assert_true(gltf_value(&v, 1, 1) == 0);
    }
}

/* A quarter turn about z, after a scale, before a shift: by hand. */
static void matrices_of_nodes(void **state)
{
    (void)state;
    static const double shift[3] = {10, 20, 30}, scale[3] = {2, 3, 4}, v[3] = {1, 1, 1};
    static const double none[4] = {0, 0, 0, 0}, large[4] = {0, 0, 3, 3};
    static const double turn[3][4] = {
        {0, 0, M_SQRT1_2, M_SQRT1_2}, {M_SQRT1_2, 0, 0, M_SQRT1_2}, {0, M_SQRT1_2, 0, M_SQRT1_2}};
    static const double want[3][3] = {{10 - 3, 20 + 2, 30 + 4}, {10 + 2, 20 - 4, 30 + 3}, {10 + 4, 20 + 3, 30 - 2}};
    gltf_matrix m, n, both;
    double out[3], twice[3];
    for (int axis = 0; axis < 3; axis++) {
        assert_true(gltf_compose(shift, turn[axis], scale, m));
        gltf_apply((const double(*)[4])m, v, out);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(out[k] - want[axis][k]) < 1e-12);
    }
    assert_false(gltf_compose(shift, none, scale, m));
    assert_true(gltf_compose(shift, large, scale, m)); /* quaternions need no length of 1 */
    gltf_apply((const double(*)[4])m, v, out);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(out[k] - want[0][k]) < 1e-12);
    assert_true(gltf_compose(scale, turn[1], shift, n));
    gltf_multiply((const double(*)[4])n, (const double(*)[4])m, both); /* m first */
    gltf_apply((const double(*)[4])n, out, twice);
    gltf_apply((const double(*)[4])both, v, out);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(out[k] - twice[k]) < 1e-10);
    gltf_multiply((const double(*)[4])n, (const double(*)[4])m, n); /* in place */
    assert_memory_equal(n, both, sizeof both);
}

/* ---- packed buffers */

static int unpack(const struct gltf_packed *p, void *out, struct sh_err *err)
{
    struct scene_build b = {.name = "m.glb"};
    struct gltf_bytes bytes;
    void *own = NULL;
    const int rc = gltf_meshopt(&b, p, "view", &own, &bytes, err);
    if (rc == SH_OK) memcpy(out, bytes.p, bytes.n);
    if (rc == SH_OK) assert_int_equal(bytes.n, p->stride * p->count);
    free(own);
    return rc;
}

/* The sizes that EXT_meshopt_compression allows. No row has data, so an allowed one fails in the decoder. */
static void sizes_of_meshopt(void **state)
{
    (void)state;
    static const struct {
        const char *mode, *filter;
        uint64_t stride, count;
        int is_allowed;
    } row[] = {{"ATTRIBUTES", NULL, 0, 4, 0},
               {"ATTRIBUTES", NULL, 4, 4, 1},
               {"ATTRIBUTES", NULL, 6, 4, 0},
               {"ATTRIBUTES", NULL, 256, 4, 1},
               {"ATTRIBUTES", NULL, 260, 4, 0},
               {"ATTRIBUTES", "OCTAHEDRAL", 4, 4, 1},
               {"ATTRIBUTES", "OCTAHEDRAL", 8, 4, 1},
               {"ATTRIBUTES", "OCTAHEDRAL", 12, 4, 0},
               {"ATTRIBUTES", "QUATERNION", 8, 4, 1},
               {"ATTRIBUTES", "QUATERNION", 4, 4, 0},
               {"ATTRIBUTES", "EXPONENTIAL", 12, 4, 1},
               {"TRIANGLES", NULL, 2, 6, 1},
               {"TRIANGLES", "NONE", 4, 6, 1},
               {"TRIANGLES", NULL, 4, 7, 0},
               {"TRIANGLES", NULL, 8, 6, 0},
               {"TRIANGLES", "OCTAHEDRAL", 4, 6, 0},
               {"TRIANGLES", "EXPONENTIAL", 4, 6, 0},
               {"INDICES", NULL, 2, 7, 1},
               {"INDICES", NULL, 4, 7, 1},
               {"INDICES", NULL, 1, 7, 0},
               {"INDICES", "QUATERNION", 4, 7, 0},
               {"INDICES", "EXPONENTIAL", 4, 7, 0}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const struct gltf_packed p = {
            .stride = row[i].stride, .count = row[i].count, .mode = row[i].mode, .filter = row[i].filter};
        struct sh_err err = {0};
        assert_int_equal(unpack(&p, NULL, &err), SH_EINPUT);
        if ((strstr(err.text, "meshopt does not allow") == NULL) != row[i].is_allowed) fail_msg("%zu: %s", i, err.text);
        if (row[i].is_allowed) assert_non_null(strstr(err.text, "meshoptimizer can't decode it"));
    }
}

/* Packed by meshoptimizer and unpacked again: a sequence of indices exactly, and floats that have few bits; unit
 * vectors within a step of 1/127, unit quaternions within a few steps of 1/32767. */
static void filters_of_meshopt(void **state)
{
    (void)state;
    static const unsigned index[5] = {7, 7, 3, 900, 0};
    static const float exact[4] = {1.5f, -2.25f, 1024.0f, 0.0f};
    /* EXT_meshopt_compression: m 2^e, with e in the upper 8 bits and m in the lower 24, both signed. */
    static const uint32_t exponential[4] = {0xff000003, 0xfefffff7, 0x0a000001, 0};
    static const float unit[2][4] = {{0.6f, 0.0f, -0.8f, 0.0f}, {-0.36f, 0.48f, 0.8f, 0.0f}};
    static const float turn[2][4] = {{0.5f, -0.5f, 0.5f, 0.5f}, {0.0f, 0.6f, 0.0f, 0.8f}};
    uint8_t packed[512], filtered[64], out[64];
    struct sh_err err;
    size_t n = meshopt_encodeIndexSequence(packed, sizeof packed, index, 5);
    assert_int_equal(unpack(&(struct gltf_packed){{packed, n}, 4, 5, "INDICES", NULL}, out, &err), SH_OK);
    assert_memory_equal(out, index, sizeof index);
    n = meshopt_encodeVertexBuffer(packed, sizeof packed, exponential, 1, sizeof exact);
    assert_int_equal(unpack(&(struct gltf_packed){{packed, n}, 16, 1, "ATTRIBUTES", "EXPONENTIAL"}, out, &err), SH_OK);
    assert_memory_equal(out, exact, sizeof exact);
    meshopt_encodeFilterOct(filtered, 2, 4, 8, unit[0]);
    n = meshopt_encodeVertexBuffer(packed, sizeof packed, filtered, 2, 4);
    assert_int_equal(unpack(&(struct gltf_packed){{packed, n}, 4, 2, "ATTRIBUTES", "OCTAHEDRAL"}, out, &err), SH_OK);
    for (int i = 0; i < 8; i++)
        if (i % 4 < 3) assert_true(fabs((int8_t)out[i] / 127.0 - (double)unit[i / 4][i % 4]) <= 1 / 127.0);
    meshopt_encodeFilterQuat(filtered, 2, 8, 16, turn[0]);
    n = meshopt_encodeVertexBuffer(packed, sizeof packed, filtered, 2, 8);
    assert_int_equal(unpack(&(struct gltf_packed){{packed, n}, 8, 2, "ATTRIBUTES", "QUATERNION"}, out, &err), SH_OK);
    for (int i = 0; i < 8; i++) /* q and -q are one turn; the encoder makes the largest component positive */
        assert_true(fabs((int16_t)le_get16(out + 2 * i) / 32767.0 - (double)turn[i / 4][i % 4]) <= 4 / 32767.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(numbers_of_each_type), cmocka_unit_test(matrices_of_nodes),
                                       cmocka_unit_test(sizes_of_meshopt), cmocka_unit_test(filters_of_meshopt)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
