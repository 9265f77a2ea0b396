/* SPDX-License-Identifier: MIT */
/* These are tests of the tree of glTF in double, scenes, instances, skins and morph targets in their default pose. */
#include "tests/unit/gltf_files.h"

#include <math.h>

#define MESH_AND_ACCESSORS                                                             \
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2}]}]," \
    "\"accessors\":[" GLTF_QUAD_ACCESSORS "]"

static void check_tree(const char *tree, const double low[3], const double high[3], double within)
{
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest, "%s," MESH_AND_ACCESSORS, tree);
    struct scene *s = gltf_load(rest);
    gltf_check_box(s, low, high, within);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

static void refuse_tree(const char *tree, const char *says)
{
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest, "%s," MESH_AND_ACCESSORS, tree);
    gltf_refuse(rest, says);
}

/* The order in JSON does not count: views may come before what refers to them, nodes after it. Without a scene all
 * roots count. */
static void order_and_scenes(void **state)
{
    (void)state;
    static const double low[3] = {-2, -1, -2}, high[3] = {2, 1, -2};
    check_tree("\"nodes\":[{\"mesh\":0}],\"scenes\":[{\"nodes\":[0]}],\"scene\":0", low, high, 0.0);
    check_tree("\"nodes\":[{\"mesh\":0}]", low, high, 0.0);
    check_tree("\"nodes\":[{\"mesh\":0,\"translation\":[9,0,0]},{\"mesh\":0}],\"scenes\":[{\"nodes\":[0]},"
               "{\"nodes\":[1]}],\"scene\":1",
               low, high, 0.0);
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest, "\"nodes\":[{\"mesh\":0},{\"mesh\":0}],\"scenes\":[{\"nodes\":[0]},{\"nodes\":[1]}],%s",
             MESH_AND_ACCESSORS);
    struct scene *s = gltf_load(rest);
    assert_int_equal(s->n_triangles, 2);
    assert_non_null(strstr(warnings, "it has 2 scenes and no default scene"));
    scene_free(s);
}

/* A quarter turn about y is given as a matrix and as a quaternion, after a scale: x goes to -z, z to x. */
static void matrices_and_their_parts(void **state)
{
    (void)state;
    static const double low[3] = {-1, -1, -4}, high[3] = {-1, 3, 4};
    check_tree("\"nodes\":[{\"mesh\":0,\"matrix\":[0,0,-2,0, 0,2,0,0, 2,0,0,0, 3,1,0,1]}]", low, high, 0.0);
    check_tree("\"nodes\":[{\"mesh\":0,\"translation\":[3,1,0],\"rotation\":[0,0.7071067811865476,0,"
               "0.7071067811865476],\"scale\":[2,2,2]}]",
               low, high, 1e-14); /* two roundings of 2^-52, of values up to 4 */
    refuse_tree("\"nodes\":[{\"mesh\":0,\"matrix\":[1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]}]",
                "nodes[0].matrix has the last row 0.5 0 0 1; allowed is 0 0 0 1");
    refuse_tree("\"nodes\":[{\"mesh\":0,\"rotation\":[0,0,0,0]}]", "nodes[0].rotation is 0 0 0 0");
    refuse_tree("\"nodes\":[{\"mesh\":0,\"scale\":[1,1]}]", "nodes[0].scale is not 3 numbers");
}

/* A shift of 5000 km that a node below undoes loses no precision: nodes are multiplied in double. */
static void the_tree_is_in_double(void **state)
{
    (void)state;
    static const double low[3] = {-1.75, -1, -2}, high[3] = {2.25, 1, -2};
    check_tree("\"nodes\":[{\"children\":[1],\"translation\":[-5000000.25,0,0]},"
               "{\"mesh\":0,\"translation\":[5000000.5,0,0]}]",
               low, high, 0.0);
}

/* Positions are floats. A position of 2 m is rounded by up to 2 * 2^-24 m. A scale makes the error larger: 100,000
 * makes it 0.0119 m, and 10,000 0.00119 m. The tolerance is 0.001 m, so both are refused; a scale of 1,000 is not. */
static void a_coarse_mesh_is_refused(void **state)
{
    (void)state;
    static const double low[3] = {-2000, -1, -2}, high[3] = {2000, 1, -2};
    refuse_tree("\"nodes\":[{\"mesh\":0,\"scale\":[100000,1,1]}]",
                "read in single precision, with errors up to 0.012 m");
    refuse_tree("\"nodes\":[{\"mesh\":0,\"scale\":[10000,1,1]}]",
                "read in single precision, with errors up to 0.0012 m");
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest, "\"nodes\":[{\"mesh\":0,\"scale\":[1000,1,1]}]," MESH_AND_ACCESSORS);
    struct scene *s = gltf_load(rest);
    gltf_check_box(s, low, high, 0.0);
    scene_free(s);
}

static void trees_that_are_none(void **state)
{
    (void)state;
    refuse_tree("\"nodes\":[{\"children\":[1]},{\"mesh\":0,\"children\":[2]},{\"children\":[1]}]",
                "nodes[1] is a child of nodes[0] and of nodes[2]; allowed is one parent");
    refuse_tree("\"nodes\":[{\"children\":[0],\"mesh\":0}]",
                "nodes[0] is in a circle of children, or below one; allowed is a tree");
    refuse_tree("\"nodes\":[{\"children\":[1],\"mesh\":0},{\"children\":[0]},{\"mesh\":0}]",
                "nodes[0] is in a circle of children, or below one; allowed is a tree");
    refuse_tree("\"nodes\":[{\"children\":[7],\"mesh\":0}]", "nodes[0].children[0] is not a node; there are 1");
    refuse_tree("\"nodes\":[{\"children\":[\"1\"],\"mesh\":0},{\"mesh\":0}]",
                "nodes[0].children[0] is not a node; there are 2");
    refuse_tree("\"scenes\":[{\"nodes\":[null]}],\"nodes\":[{\"mesh\":0}]",
                "scenes[0].nodes[0] is not a node; there are 1");
    refuse_tree("\"scenes\":[{\"nodes\":[0,1]}],\"nodes\":[{\"children\":[1]},{\"mesh\":0}]",
                "scenes[0].nodes has nodes[1], which is a child of nodes[0]");
    refuse_tree("\"scenes\":[{\"nodes\":[0,0]}],\"nodes\":[{\"mesh\":0}]", "scenes[0].nodes has nodes[0] twice");
    refuse_tree("\"nodes\":[{\"mesh\":3}]", "meshes[3] is missing: there are 1");
}

/* A wrong index is an error where a drawn node needs it, else a warning. Each names the first one. */
static void indices_of_nothing(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *says;
    } as[] = {
        {"\"mesh\":0", "\"mesh\":0,\"camera\":4", "nodes[0].camera is 4, but there are 0 cameras"},
        {"\"at\":1", "\"bufferView\":9", "images[0].bufferView is 9, but there are 3 bufferViews"},
        {"\"tx\":1", "\"source\":1,\"sampler\":2", "textures[0].source is 1, but there are 1 images"},
        {"\"mx\":1", "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":3}}",
         "materials[0].pbrMetallicRoughness.baseColorTexture.index is 3, but there are 1 textures"},
        {"\"mx\":1", "\"extensions\":{\"KHR_materials_clearcoat\":{\"clearcoatTexture\":{\"index\":-1}}}",
         "KHR_materials_clearcoat.clearcoatTex.index is -1, but there are 1 textures"},
        {"\"sx\":1", "\"joints\":[0,1,5],\"inverseBindMatrices\":0", "skins[0].joints[2] is 5, but there are 2 nodes"},
        {"\"px\":1", "\"material\":6", "meshes[1].primitives[0].material is 6, but there are 1 materials"},
        {"\"px\":1", "\"targets\":[{\"POSITION\":0},{\"NORMAL\":8}]",
         "meshes[1].primitives[0].targets[1].NORMAL is 8, but there are 3 accessors"},
        {"\"nx\":1", "\"mesh\":2,\"skin\":3", "2 indices name missing elements; the first: nodes[1].mesh is 2"},
        {"\"ex\":1", "\"EXT_mesh_gpu_instancing\":{\"attributes\":{\"SCALE\":9}}",
         "SCALE is 9, but there are 3 accessors"},
    };
    static const char base[] =
        "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0},{\"nx\":1,\"extensions\":{\"ex\":1}}],"
        "\"images\":[{\"at\":1}],\"textures\":[{\"tx\":1}],\"materials\":[{\"mx\":1}],\"skins\":[{\"sx\":1}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2}]},"
        "{\"primitives\":[{\"px\":1}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS "]";
    for (size_t i = 0; i < sizeof as / sizeof as[0]; i++) {
        char rest[2048];
        const char *at = strstr(base, as[i].old);
        snprintf(rest, sizeof rest, "%.*s%s%s", (int)(at - base), base, as[i].with, at + strlen(as[i].old));
        gltf_quad();
        struct scene *s = gltf_load(rest);
        if (n_warnings != 1 || strstr(warnings, as[i].says) == NULL) fail_msg("%zu: %s", i, warnings);
        scene_free(s);
    }
    n_warnings = 0; /* there is the error, and no warning beside it */
    refuse_tree("\"nodes\":[{\"mesh\":0,\"skin\":3}]", "skins[3] is missing: there are 0");
    assert_int_equal(n_warnings, 0);
    gltf_quad();
    gltf_refuse("\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
                "\"accessors\":[{\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"sparse\":{\"count\":1,"
                "\"indices\":{\"componentType\":5123},\"values\":{\"bufferView\":0}}}]",
                "an index into bufferViews is missing");
}

/* A chain as long as a file may make it does not use up the stack. */
static void a_deep_chain_is_walked(void **state)
{
    (void)state;
    enum { DEEP = 5000 };
    static char rest[DEEP * 48 + 2048];
    size_t at = (size_t)snprintf(rest, sizeof rest, "\"nodes\":[");
    for (int i = 0; i + 1 < DEEP; i++)
        at += (size_t)snprintf(rest + at, sizeof rest - at, "{\"children\":[%d],\"translation\":[1,0,0]},", i + 1);
    snprintf(rest + at, sizeof rest - at, "{\"mesh\":0}]," MESH_AND_ACCESSORS);
    assert_true(strlen(rest) < 400000);
    gltf_quad();
    struct scene *s = gltf_load(rest);
    assert_true(s->min_m[0] == DEEP - 1 - 2 && s->max_m[0] == DEEP - 1 + 2);
    scene_free(s);
}

/* There are two instances. The second is 3 m away, turned by a quarter about z and half as large. */
static void instances_are_written_out(void **state)
{
    (void)state;
    static const float t[2][3] = {{0, 0, 0}, {3, 0, 0}}, s[2][3] = {{1, 1, 1}, {0.5f, 0.5f, 0.5f}};
    static const int16_t r[2][4] = {{0, 0, 0, 32767}, {0, 0, 23170, 23170}};
    static const double low[3] = {-2, -1, -2}, high[3] = {3.5, 1, -1};
    gltf_quad();
    gltf_block(t, sizeof t, "");
    gltf_block(r, sizeof r, "");
    gltf_block(s, sizeof s, "");
    struct scene *scene = gltf_load(
        "\"extensionsRequired\":[\"EXT_mesh_gpu_instancing\"],\"nodes\":[{\"mesh\":0,\"name\":\"tree\",\"extensions\":{"
        "\"EXT_mesh_gpu_instancing\":{\"attributes\":{\"TRANSLATION\":3,\"ROTATION\":4,\"SCALE\":5,\"_ID\":0}}}}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2}]}],"
        "\"accessors\":[" GLTF_QUAD_ACCESSORS
        ",{\"bufferView\":3,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"},"
        "{\"bufferView\":4,\"componentType\":5122,\"normalized\":true,\"count\":2,\"type\":\"VEC4\"},"
        "{\"bufferView\":5,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}]");
    assert_int_equal(scene->n_triangles, 4);
    assert_int_equal(scene->n_surfaces, 1);
    assert_string_equal(scene->surface[0].object, "tree");
    gltf_check_box(scene, low, high, 1e-14);
    assert_true(fabs(total_area(scene) - 10.0) < 1e-12);
    scene_free(scene);
}

/* glTF 2.0, 3.7.4: a transform with a negative determinant reverses the winding. So the pyramid from the origin to the
 * quad, 4 by 2 by 2 m, has the volume -16/3 however it is mirrored. */
static void mirrored_nodes_keep_their_outer_side(void **state)
{
    (void)state;
    static const struct {
        const char *tree;
        double factor; /* of the volume: that of the scales */
    } tries[] = {{"\"nodes\":[{\"mesh\":0}]", 1},
                 {"\"nodes\":[{\"mesh\":0,\"scale\":[-1,1,1]}]", 1},
                 {"\"nodes\":[{\"mesh\":0,\"scale\":[-1,-3,1]}]", 3},
                 {"\"nodes\":[{\"mesh\":0,\"scale\":[-1,-1,-2]}]", 2},
                 {"\"nodes\":[{\"children\":[1],\"scale\":[1,1,-1]},{\"mesh\":0,\"scale\":[1,-1,1]}]", 1},
                 {"\"nodes\":[{\"children\":[1],\"scale\":[1,1,-1]},{\"mesh\":0,\"scale\":[1,1,1]}]", 1},
                 {"\"nodes\":[{\"mesh\":0,\"matrix\":[0,1,0,0, 1,0,0,0, 0,0,1,0, 0,0,0,1]}]", 1}};
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        gltf_quad();
        snprintf(rest, sizeof rest, "%s," MESH_AND_ACCESSORS, tries[i].tree);
        struct scene *s = gltf_load(rest);
        if (!(fabs(total_volume(s) + tries[i].factor * 16.0 / 3.0) < 1e-12)) fail_msg("%zu: %g", i, total_volume(s));
        scene_free(s);
    }
}

/* Texture coordinates stay with their corners: u = (x + 2) / 4 in the file, and x is mirrored. */
static void mirrored_instances_keep_their_outer_side(void **state)
{
    (void)state;
    static const float size[2][3] = {{1, 1, 1}, {-1, 1, 1}};
    gltf_quad();
    gltf_block(size, sizeof size, "");
    struct scene *s = gltf_load(
        "\"nodes\":[{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{\"SCALE\":3}}}}],"
        "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],\"textures\":[{\"source\":0}],"
        "\"images\":[{\"uri\":\"none.png\"}],\"meshes\":[" GLTF_QUAD_MESH "],\"accessors\":[" GLTF_QUAD_ACCESSORS
        ",{\"bufferView\":3,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}]");
    assert_int_equal(s->n_triangles, 4);
    assert_true(fabs(total_volume(s) + 2.0 * 16.0 / 3.0) < 1e-12);
    for (uint32_t i = 0; i < 4; i++)
        for (int c = 0; c < 3; c++) {
            const double x = s->vertex_m[s->triangle[i][c]][0];
            assert_true(s->uv != NULL && (double)s->uv[i][c][0] == ((i < 2 ? x : -x) + 2) / 4);
        }
    scene_free(s);
}

/* KHR_node_visibility: nodes below a hidden one are hidden, and reported. */
static void hidden_nodes_are_left_out(void **state)
{
    (void)state;
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest,
             "\"extensionsRequired\":[\"KHR_node_visibility\"],\"nodes\":[{\"mesh\":0},{\"children\":[2],"
             "\"extensions\":{\"KHR_node_visibility\":{\"visible\":false}}},{\"mesh\":0}],%s",
             MESH_AND_ACCESSORS);
    struct scene *s = gltf_load(rest);
    assert_int_equal(s->n_triangles, 2);
    assert_non_null(strstr(warnings, "1 nodes are hidden (KHR_node_visibility)"));
    scene_free(s);
}

/* ---- poses */

/* The quad has two joints. The quad's left corners are on one at x = 10, half as large. Its right corners are on
 * another joint in a second set, which stands where it was bound. The mesh's own node is far away, and moves
 * nothing. */
static void skins_in_their_default_pose(void **state)
{
    (void)state;
    static const uint8_t joint[2][4][4] = {{{0}, {1}, {1}, {0}}, {{1}, {1}, {1}, {1}}};
    static const float weight[2][4][4] = {{{1}, {0}, {0}, {1}}, {{0}, {1}, {1}, {0}}};
    static const float bind[2][16] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 0, 2, 1},
                                      {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 2, 1}};
    static const double low[3] = {2, -1, 0}, high[3] = {10, 1, 0};
    gltf_quad();
    for (int i = 0; i < 2; i++)
        gltf_block(joint[i], sizeof joint[i], "");
    for (int i = 0; i < 2; i++)
        gltf_block(weight[i], sizeof weight[i], "");
    gltf_block(bind, sizeof bind, "");
    struct scene *s = gltf_load(
        "\"nodes\":[{\"mesh\":0,\"skin\":0,\"translation\":[100,0,0]},{\"children\":[2],\"translation\":[10,0,0]},"
        "{\"scale\":[0.5,0.5,0.5]},{\"translation\":[0,0,0]}],\"skins\":[{\"joints\":[2,3],\"inverseBindMatrices\":7}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"JOINTS_0\":3,\"JOINTS_1\":4,\"WEIGHTS_0\":5,"
        "\"WEIGHTS_1\":6},\"indices\":2}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
        ",{\"bufferView\":3,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},"
        "{\"bufferView\":4,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},"
        "{\"bufferView\":5,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"},"
        "{\"bufferView\":6,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"},"
        "{\"bufferView\":7,\"componentType\":5126,\"count\":2,\"type\":\"MAT4\"}]");
    gltf_check_box(s, low, high, 1e-14);
    assert_null(strstr(warnings, "weights"));
    /* the right side is 2 high at x = 2, the left one 1 at x = 10 */
    assert_true(fabs(total_area(s) - 12.0) < 1e-12);
    scene_free(s);
}

/* Targets count by the mesh's weights, unless the node has some; without either none counts. */
static void morph_targets_by_default_weights(void **state)
{
    (void)state;
    static const float up[4][3] = {{0, 0, 4}, {0, 0, 4}, {0, 0, 4}, {0, 0, 4}};
    static const struct {
        const char *node, *mesh;
        double z;
    } tries[] = {{"", "", -2.0},
                 {"", ",\"weights\":[0.5]", 0.0},
                 {",\"weights\":[1]", ",\"weights\":[0.5]", 2.0},
                 {",\"weights\":[0]", ",\"weights\":[0.5]", -2.0}};
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        const double low[3] = {-2, -1, tries[i].z}, high[3] = {2, 1, tries[i].z};
        gltf_quad();
        gltf_block(up, sizeof up, "");
        snprintf(rest, sizeof rest,
                 "\"nodes\":[{\"mesh\":0%s}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},"
                 "\"indices\":2,\"targets\":[{\"POSITION\":3}]}]%s}],\"accessors\":[" GLTF_QUAD_ACCESSORS
                 ",{\"bufferView\":3,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"}]",
                 tries[i].node, tries[i].mesh);
        struct scene *s = gltf_load(rest);
        gltf_check_box(s, low, high, 0.0);
        scene_free(s);
    }
}

/* A target of bytes, at a weight of 0.01, is rounded by up to half of 0.01 m. Scaled by two, that is 0.01 m. */
static void morph_targets_may_be_whole_numbers(void **state)
{
    (void)state;
    static const int8_t up[4][4] = {{0, 0, 100}, {0, 0, 100}, {0, 0, 100}, {0, 0, 100}};
    static const double low[3] = {-4, -2, -2}, high[3] = {4, 2, -2};
    gltf_quad();
    gltf_block(up, sizeof up, ",\"byteStride\":4");
    struct scene *s = gltf_load(
        "\"extensionsRequired\":[\"KHR_mesh_quantization\"],\"nodes\":[{\"mesh\":0,\"scale\":[2,2,2]}],\"meshes\":[{"
        "\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2,\"targets\":[{\"POSITION\":3}]}],"
        "\"weights\":[0.01]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
        ",{\"bufferView\":3,\"componentType\":5120,\"count\":4,\"type\":\"VEC3\"}]");
    gltf_check_box(s, low, high, 1e-14); /* z: 2 (-2 + 0.01 * 100) */
    assert_true(fabs(s->error_m - 0.01) < 1e-15);
    assert_non_null(strstr(warnings, "(KHR_mesh_quantization), with errors up to 0.01 m"));
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(order_and_scenes),
        cmocka_unit_test(matrices_and_their_parts),
        cmocka_unit_test(the_tree_is_in_double),
        cmocka_unit_test(a_coarse_mesh_is_refused),
        cmocka_unit_test(trees_that_are_none),
        cmocka_unit_test(indices_of_nothing),
        cmocka_unit_test(a_deep_chain_is_walked),
        cmocka_unit_test(instances_are_written_out),
        cmocka_unit_test(mirrored_nodes_keep_their_outer_side),
        cmocka_unit_test(mirrored_instances_keep_their_outer_side),
        cmocka_unit_test(hidden_nodes_are_left_out),
        cmocka_unit_test(skins_in_their_default_pose),
        cmocka_unit_test(morph_targets_by_default_weights),
        cmocka_unit_test(morph_targets_may_be_whole_numbers),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
