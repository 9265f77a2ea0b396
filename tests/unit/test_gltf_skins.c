/* SPDX-License-Identifier: MIT */
/* Skins of glTF with several sets of joints, beside linear blending worked out here; and meshes whose parts don't fit
 * together. */
#include <math.h>

#include "tests/unit/gltf_files.h"

enum { SETS = 2, JOINTS = 4 * SETS };

/* Corner k is moved by joint (3 j + k) % 8 with weight[k][j]; the weights of a corner need not add up to 1. */
static const float weight[4][JOINTS] = {{0.5f, 0.25f, 0, 0.125f, 0, 0.0625f, 0.0625f, 0},
                                        {0, 0, 0, 0, 0, 0, 0, 1},
                                        {0.125f, 0.125f, 0.125f, 0.125f, 0.125f, 0.125f, 0.125f, 0.125f},
                                        {0.5f, 0, 0, 0, 0, 0, 0, 0.25f}};
static const double corner[4][3] = {{-2, -1, -2}, {2, -1, -2}, {2, 1, -2}, {-2, 1, -2}};

static int joint_of(int k, int j)
{
    return (3 * j + k) % JOINTS;
}

/* Affine matrices, row by row: multiples of 1/16, which floats hold exactly. */
static void joint_matrix(int j, double m[3][4])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++)
            m[r][c] = c == 3 ? 0.5 * ((5 * j + 3 * r) % 7 - 3) : (r == c) + ((j + 3 * r + 5 * c) % 9 - 4) / 16.0;
}

static void bind_matrix(int j, double m[3][4])
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++)
            m[r][c] = c == 3 ? 0.25 * ((2 * j + 5 * r) % 5 - 2) : (r == c) - ((3 * j + 2 * r + c) % 7 - 3) / 16.0;
}

static void apply(double m[3][4], const double p[3], double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = m[r][0] * p[0] + m[r][1] * p[1] + m[r][2] * p[2] + m[r][3];
}

/* The same with absolute values: rounding errors are a share of them. */
static void reach(double m[3][4], const double p[3], double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = fabs(m[r][0]) * p[0] + fabs(m[r][1]) * p[1] + fabs(m[r][2]) * p[2] + fabs(m[r][3]);
}

/* Writes where a corner goes. Returns the largest sum of absolute values. */
static double blend(int k, double out[3])
{
    double sum = 0, far[3] = {0}, most = 0;
    memset(out, 0, 3 * sizeof *out);
    for (int j = 0; j < JOINTS; j++) {
        const double w = (double)weight[k][j], size[3] = {fabs(corner[k][0]), fabs(corner[k][1]), fabs(corner[k][2])};
        double bind[3][4], joint[3][4], at[3], to[3];
        bind_matrix(joint_of(k, j), bind);
        joint_matrix(joint_of(k, j), joint);
        apply(bind, corner[k], at);
        apply(joint, at, to);
        for (int r = 0; r < 3; r++)
            out[r] += w * to[r];
        reach(bind, size, at);
        reach(joint, at, to);
        for (int r = 0; r < 3; r++)
            far[r] += w * to[r];
        sum += w;
    }
    for (int r = 0; r < 3; r++) {
        out[r] /= sum;
        most = fmax(most, far[r] / sum);
    }
    return most;
}

/* Adds the blocks of the skin: joints, weights, and inverse bind matrices. */
static void add_blocks(void)
{
    gltf_quad();
    for (int set = 0; set < SETS; set++) {
        uint8_t joint[4][4];
        float w[4][4];
        for (int k = 0; k < 4; k++)
            for (int i = 0; i < 4; i++) {
                joint[k][i] = (uint8_t)joint_of(k, 4 * set + i);
                w[k][i] = weight[k][4 * set + i];
            }
        gltf_block(joint, sizeof joint, "");
        gltf_block(w, sizeof w, "");
    }
    float bind[JOINTS][16] = {{0}};
    for (int j = 0; j < JOINTS; j++) {
        double m[3][4];
        bind_matrix(j, m);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 4; c++)
                bind[j][4 * c + r] = (float)m[r][c];
        bind[j][15] = 1;
    }
    gltf_block(bind, sizeof bind, "");
}

/* Nodes: the mesh, then the joints. */
static int put_nodes(char *to, size_t room)
{
    int n = snprintf(to, room, "\"nodes\":[{\"mesh\":0,\"skin\":0,\"translation\":[100,0,0]}");
    for (int j = 0; j < JOINTS; j++) {
        double m[3][4];
        joint_matrix(j, m);
        n += snprintf(to + n, room - (size_t)n, ",{\"matrix\":[");
        for (int c = 0; c < 4; c++)
            n += snprintf(to + n, room - (size_t)n, "%.17g,%.17g,%.17g,%d%s", m[0][c], m[1][c], m[2][c], c == 3,
                          c == 3 ? "]}" : ",");
    }
    return n + snprintf(to + n, room - (size_t)n, "],");
}

#define SKIN_ACCESSORS                                                          \
    GLTF_QUAD_ACCESSORS                                                         \
    ",{\"bufferView\":3,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"}," \
    "{\"bufferView\":4,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"},"  \
    "{\"bufferView\":5,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},"  \
    "{\"bufferView\":6,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"},"  \
    "{\"bufferView\":7,\"componentType\":5126,\"count\":8,\"type\":\"MAT4\"}"
#define SKIN_MESH                                                                                                 \
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"JOINTS_0\":3,\"WEIGHTS_0\":4,\"JOINTS_1\":5," \
    "\"WEIGHTS_1\":6},\"indices\":2}]}]"

static void eight_joints_a_corner(void **state)
{
    (void)state;
    char rest[8192];
    double most = 0;
    add_blocks();
    const int n = put_nodes(rest, sizeof rest);
    snprintf(rest + n, sizeof rest - (size_t)n,
             "\"skins\":[{\"joints\":[1,2,3,4,5,6,7,8],\"inverseBindMatrices\":7}]," SKIN_MESH
             ",\"accessors\":[" SKIN_ACCESSORS "]");
    struct scene *s = gltf_load(rest);
    assert_int_equal(s->n_vertices, 4);
    for (int k = 0; k < 4; k++) {
        double want[3];
        most = fmax(most, blend(k, want));
        for (int r = 0; r < 3; r++)
            if (!(fabs(s->vertex_m[k][r] - want[r]) < 1e-12))
                fail_msg("corner %d: %g, %g", k, s->vertex_m[k][r], want[r]);
    }
    /* Floats of positions and of inverse bind matrices have errors up to 6e-8 each. The error is rounded up to two
     * digits. */
    const double error_m = 2 * 6e-8 * most;
    if (!(s->error_m >= error_m && s->error_m < 1.1 * error_m)) fail_msg("%g m, not %g m", s->error_m, error_m);
    scene_free(s);
}

/* Writes the skin with its first set of joints n times over. bind: empty, or names the inverse bind matrices. */
static void put_sets(int n_sets, const char *bind, char *rest, size_t room)
{
    add_blocks();
    int n = put_nodes(rest, room);
    n += snprintf(rest + n, room - (size_t)n,
                  "\"skins\":[{\"joints\":[1,2,3,4,5,6,7,8]%s}],"
                  "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0",
                  bind);
    for (int set = 0; set < n_sets; set++)
        n += snprintf(rest + n, room - (size_t)n, ",\"JOINTS_%d\":3,\"WEIGHTS_%d\":4", set, set);
    snprintf(rest + n, room - (size_t)n, "},\"indices\":2}]}],\"accessors\":[" SKIN_ACCESSORS "]");
}

#define BIND ",\"inverseBindMatrices\":7"

/* Weights are divided by their sum, so a set that is there eight times moves a corner as the set alone does. There are
 * eight sets at most. Corner 1 has no weight in the set, and so stays. */
static void eight_sets_a_corner(void **state)
{
    (void)state;
    char rest[8192];
    put_sets(1, BIND, rest, sizeof rest);
    struct scene *one = gltf_load(rest);
    put_sets(8, BIND, rest, sizeof rest);
    struct scene *eight = gltf_load(rest);
    assert_true(one->n_vertices == 4 && eight->n_vertices == 4);
    for (int k = 0; k < 4; k++)
        for (int r = 0; r < 3; r++)
            assert_true(fabs(one->vertex_m[k][r] - eight->vertex_m[k][r]) < 1e-12);
    scene_free(one);
    scene_free(eight);
    put_sets(9, BIND, rest, sizeof rest);
    gltf_refuse(rest, "has more than 8 sets of joints");
}

/* Without inverse bind matrices a joint's matrix is that of its node. Corner 1 has no weight in the first set, and so
 * stays. */
static void joints_without_bind_matrices(void **state)
{
    (void)state;
    char rest[8192];
    put_sets(1, "", rest, sizeof rest);
    struct scene *s = gltf_load(rest);
    assert_non_null(strstr(warnings, ": 1 vertices of a skin have no weights: no joint moves them"));
    for (int k = 0; k < 4; k++) {
        double want[3] = {0, 0, 0}, sum = 0;
        for (int j = 0; j < 4; j++) {
            double joint[3][4], to[3];
            joint_matrix(joint_of(k, j), joint);
            apply(joint, corner[k], to);
            for (int r = 0; r < 3; r++)
                want[r] += (double)weight[k][j] * to[r];
            sum += (double)weight[k][j];
        }
        for (int r = 0; r < 3; r++)
            assert_true(fabs(s->vertex_m[k][r] - (sum > 0 ? want[r] / sum : corner[k][r])) < 1e-12);
    }
    scene_free(s);
}

static void skins_that_do_not_fit(void **state)
{
    (void)state;
    static const struct {
        const char *skin, *accessor, *says; /* accessor: in place of the first set of joints */
    } row[] = {
        {"\"joints\":[1,2,3,4,5,6,7],\"inverseBindMatrices\":7", NULL, "has joint 7; its skin has 7"},
        {"\"joints\":[]", NULL, "skins[0] has no joints"},
        {"\"joints\":[1,2,3,4,5,6,7,8,1],\"inverseBindMatrices\":7", NULL,
         "skins[0] has 9 joints and 8 inverse bind matrices"},
        {"\"joints\":[1,2,3,4,5,6,7,8]", ",{\"bufferView\":3,\"componentType\":5121,\"count\":3,\"type\":\"VEC4\"}",
         "JOINTS_0 and WEIGHTS_0 differ in number from the vertices"},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        static const char all[] = SKIN_ACCESSORS;
        char rest[8192];
        add_blocks();
        const int n = put_nodes(rest, sizeof rest);
        const size_t quad = strlen(GLTF_QUAD_ACCESSORS);
        const char *others = row[i].accessor != NULL ? strstr(all + quad + 2, ",{\"bufferView\":4") : all + quad;
        snprintf(rest + n, sizeof rest - (size_t)n,
                 "\"skins\":[{%s}]," SKIN_MESH ",\"accessors\":[" GLTF_QUAD_ACCESSORS "%s%s]", row[i].skin,
                 row[i].accessor != NULL ? row[i].accessor : "", others);
        gltf_refuse(rest, row[i].says);
    }
}

/* Coordinates of textures and colours must be enough for all vertices, and indices whole numbers. */
static void attributes_that_do_not_fit(void **state)
{
    (void)state;
    static const struct {
        const char *attributes, *indices, *accessor, *says; /* accessor 3 */
    } row[] = {
        {",\"TEXCOORD_0\":3", "2", "\"bufferView\":1,\"componentType\":5126,\"count\":3,\"type\":\"VEC2\"",
         "3 texture coordinates for 4 vertices"},
        {",\"COLOR_0\":3", "2", "\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"",
         "3 colours for 4 vertices"},
        {"", "3", "\"bufferView\":1,\"componentType\":5126,\"count\":6,\"type\":\"SCALAR\"",
         "has numbers that are not whole or below 0"},
        {"", "3", "\"bufferView\":1,\"componentType\":5122,\"count\":6,\"type\":\"SCALAR\"",
         "has numbers that are not whole or below 0"},
        {"", "3", "\"bufferView\":2,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\",\"normalized\":true",
         "has numbers that are not whole or below 0"},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char rest[2048];
        gltf_quad();
        snprintf(rest, sizeof rest,
                 "\"nodes\":[{\"mesh\":0}],\"images\":[{\"uri\":\"a.png\"}],\"textures\":[{\"source\":0}],"
                 "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],"
                 "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0%s},\"indices\":%s,\"material\":0}]}],"
                 "\"accessors\":[" GLTF_QUAD_ACCESSORS ",{%s}]",
                 row[i].attributes, row[i].indices, row[i].accessor);
        gltf_refuse(rest, row[i].says);
    }
}

/* The joints place a mesh with a skin, not its node. A corner belongs to joint 0 (nodes[1]), or to joint 1, which stays
 * where it was bound. */
static void mirrored_joints_keep_the_outer_side(void **state)
{
    (void)state;
    static const struct {
        const char *node, *joint;
        uint8_t of[4]; /* the joint of each corner */
        double volume;
    } tries[] = {{"[1,1,1]", "[1,1,1]", {0}, -16.0 / 3.0},
                 {"[-1,1,1]", "[1,1,1]", {0}, -16.0 / 3.0},
                 {"[1,1,1]", "[-1,1,1]", {0}, -16.0 / 3.0},
                 {"[-1,1,1]", "[1,1,-2]", {0}, -32.0 / 3.0},
                 {"[1,1,1]", "[-1,1,1]", {1, 1, 1, 1}, -16.0 / 3.0}};
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        uint8_t of[4][4] = {{0}};
        static const uint8_t whole[4][4] = {{255}, {255}, {255}, {255}};
        for (int k = 0; k < 4; k++)
            of[k][0] = tries[i].of[k];
        gltf_quad();
        gltf_block(of, sizeof of, "");
        gltf_block(whole, sizeof whole, "");
        snprintf(rest, sizeof rest,
                 "\"nodes\":[{\"mesh\":0,\"skin\":0,\"scale\":%s},{\"scale\":%s},{}],\"skins\":[{\"joints\":[1,2]}],"
                 "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"JOINTS_0\":3,\"WEIGHTS_0\":4},"
                 "\"indices\":2}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
                 ",{\"bufferView\":3,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},"
                 "{\"bufferView\":4,\"componentType\":5121,\"normalized\":true,\"count\":4,\"type\":\"VEC4\"}]",
                 tries[i].node, tries[i].joint);
        struct scene *s = gltf_load(rest);
        if (!(fabs(total_volume(s) - tries[i].volume) < 1e-12)) fail_msg("%zu: %g", i, total_volume(s));
        scene_free(s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(eight_joints_a_corner),        cmocka_unit_test(eight_sets_a_corner),
        cmocka_unit_test(joints_without_bind_matrices), cmocka_unit_test(skins_that_do_not_fit),
        cmocka_unit_test(attributes_that_do_not_fit),   cmocka_unit_test(mirrored_joints_keep_the_outer_side),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
