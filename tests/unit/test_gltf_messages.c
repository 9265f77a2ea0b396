/* SPDX-License-Identifier: MIT */
/* What is said of a glTF file whose parts contradict each other, with the place and the figures in it; and counts of
 * parts that are left out. */
#include "tests/unit/gltf_files.h"

#define PRIMITIVE "{\"attributes\":{\"POSITION\":0},\"indices\":2}"
#define NODE      "\"nodes\":[{\"mesh\":0}],"
#define MESH      "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}],"
#define ACCESSORS "\"accessors\":[" GLTF_QUAD_ACCESSORS
/* Blocks 3 and 4 are zeros: accessor 3 has three vectors, accessor 4 a rotation. */
#define MORE_ACCESSORS                                                                    \
    ACCESSORS ",{\"bufferView\":3,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}," \
              "{\"bufferView\":4,\"componentType\":5126,\"count\":1,\"type\":\"VEC4\"}]"
#define INSTANCES(attributes) "\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{" attributes "}}}"

static void contradictions_are_named(void **state)
{
    (void)state;
    static const char zero[64];
    static const struct {
        const char *rest, *says;
    } row[] = {
        {NODE
         "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2,\"mode\":7}]}]," MORE_ACCESSORS,
         "meshes[0].primitives[0].mode is 7; allowed are 0 to 6"},
        {"\"nodes\":[{\"mesh\":-1}]," MESH MORE_ACCESSORS, ": nodes[0].mesh is not a whole number from 0 on"},
        {"\"nodes\":[{\"mesh\":0,\"children\":1}]," MESH MORE_ACCESSORS, ": nodes[0].children is not a list"},
        {"\"nodes\":{}," MESH MORE_ACCESSORS, ": nodes is not a list"},
        {"\"scene\":0.5," NODE MESH MORE_ACCESSORS, ": scene is not a whole number from 0 on"},
        {"\"nodes\":[{\"mesh\":4294967295}]," MESH MORE_ACCESSORS,
         "nodes[0].mesh is 4294967295; allowed are indices below 4294967295"},
        {"\"nodes\":[{\"mesh\":0," INSTANCES("\"_ID\":0") "}]," MESH MORE_ACCESSORS,
         "nodes[0].extensions.EXT_mesh_gpu_instancing.attributes has none of TRANSLATION, ROTATION and SCALE"},
        {"\"nodes\":[{\"mesh\":0," INSTANCES("\"TRANSLATION\":0,\"SCALE\":3") "}]," MESH MORE_ACCESSORS,
         "nodes[0].extensions.EXT_mesh_gpu_instancing.attributes has 3 values of SCALE but 4 of another property"},
        {"\"nodes\":[{\"mesh\":0," INSTANCES("\"ROTATION\":4") "}]," MESH MORE_ACCESSORS,
         "nodes[0].extensions.EXT_mesh_gpu_instancing.attributes: instance 0 has the rotation 0 0 0 0, which is not a "
         "rotation"},
        {"\"nodes\":[{\"mesh\":0,\"skin\":0," INSTANCES(
             "\"SCALE\":0") "}],\"skins\":[{\"joints\":[0]}]," MESH MORE_ACCESSORS,
         "nodes[0] has a skin and instances; allowed is one of them"},
        {NODE
         "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2,\"targets\":[{\"POSITION\":3}]}],"
         "\"weights\":[1]}]," MORE_ACCESSORS,
         "POSITION has 3 elements for 4 vertices"},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        gltf_quad();
        gltf_block(zero, 36, "");
        gltf_block(zero, 16, "");
        gltf_refuse(row[i].rest, row[i].says);
    }
}

/* The right buffer view gets a second member of the same name, which replaces its first one. */
static void views_beyond_their_buffer_are_named(void **state)
{
    (void)state;
    static const float p[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    static const struct {
        const char *more, *says;
    } row[] = {
        {",\"byteStride\":65537", "bufferViews[0].byteStride is 65537; allowed are up to 65536"},
        {",\"byteOffset\":1", "bufferViews[0]: bytes 1 to 49 go beyond buffers[0], which has 48"},
        {",\"byteLength\":49", "bufferViews[0]: bytes 0 to 49 go beyond buffers[0], which has 48"},
        {",\"byteOffset\":49,\"byteLength\":0", "bufferViews[0]: bytes 49 to 49 go beyond buffers[0], which has 48"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        gltf_begin();
        gltf_block(p, sizeof p, row[i].more);
        gltf_refuse(NODE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"accessors\":["
                         "{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"}]",
                    row[i].says);
    }
}

static void refuse_text(const char *text, const char *says)
{
    refuse("a.gltf", text, strlen(text), says);
}

static void versions_and_data_are_named(void **state)
{
    (void)state;
    refuse("a.glb", "glTF\3\0\0\0\14\0\0\0", 12, "it is a .glb of version 3; allowed are 1 and 2");
    refuse_text("{\"asset\":{\"version\":\"2.0\",\"minVersion\":\"2.1\"}}", "asset.minVersion is 2.1; allowed is 2.0");
    refuse_text("{\"asset\":{\"version\":\"3.0\"}}", "asset.version is 3.0; allowed are 1.0 and 2.x");
    refuse_text("{}", "asset.version is not there; allowed are 1.0 and 2.x");
    refuse_text("[]", "its JSON is not an object");
    refuse_text("{\n\n\"asset\":{\"version\":2.0}!}", "its JSON can't be read: line 3, column 24: ");
#define DATA(uri)                                                                                                  \
    "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"" uri "\"}],\"bufferViews\":["     \
    "{\"buffer\":0,\"byteLength\":36}]," NODE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}]," \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}"
    refuse_text(DATA("data:application/octet-stream;base64,AA*A"), "buffers[0].uri: byte 39 is not a base64 character");
    refuse_text(DATA("data:application/octet-stream,AAAA"), "buffers[0].uri must have its data in base64");
}

/* The header of a .glb, 12 bytes, and of a chunk, 8 bytes; lengths are little-endian. */
#define GLB(length)         "glTF\2\0\0\0" length "\0\0\0"
#define CHUNK(length, type) length "\0\0\0" type

static void cut_files_are_named(void **state)
{
    (void)state;
    static const struct {
        const char *file;
        size_t size;
        const char *says;
    } row[] = {
        {GLB("\100"), 12, "a.glb: cut off: it has 12 bytes, but its header says 64"},
        {GLB("\14"), 12, "a.glb: it has no JSON in it"},
        {GLB("\23") CHUNK("\0", "JSO"), 19, "a.glb: the chunk at byte 12 goes beyond its end, byte 19"},
        {GLB("\24") CHUNK("\1", "JSON"), 20, "a.glb: the chunk at byte 12 goes beyond its end, byte 20"},
        {GLB("\31") CHUNK("\4", "JSON") "{}  x", 25, "a.glb: the chunk at byte 24 goes beyond its end, byte 25"},
        {GLB("\40") CHUNK("\4", "JSOX") "{}  " CHUNK("\1", "JSON"), 32,
         "a.glb: the chunk at byte 24 goes beyond its end, byte 32"},
        {GLB("\30") CHUNK("\4", "JSOX") "{}  ", 24, "a.glb: it has no JSON in it"},
        {GLB("\30") CHUNK("\4", "JSON") "[]  ", 24, "a.glb: its JSON is not an object"},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        refuse("a.glb", row[i].file, row[i].size, row[i].says);
}

static void buffers_are_named(void **state)
{
    (void)state;
#define BUFFERS(buffers, view)                                                                                       \
    "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[" buffers "],\"bufferViews\":[{" view "\"byteLength\":36}]," NODE \
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"                                             \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}"
    refuse_text(BUFFERS("{\"byteLength\":36}", "\"buffer\":0,"), "a.gltf: buffers[0] has no data");
    refuse_text(BUFFERS("{},{\"byteLength\":36}", "\"buffer\":1,"), "a.gltf: buffers[1] has no data");
    refuse_text(BUFFERS("{},{}", "\"buffer\":2,"), "buffers[2] is missing: there are 2");
    refuse_text(BUFFERS("{}", ""), "a buffer view names no buffer");
    refuse_text(BUFFERS("{\"byteLength\":36,\"uri\":\"data:;base64,AAAA\"}", "\"buffer\":0,"),
                "a.gltf: buffers[0] is cut off: 3 bytes of 36");
    refuse_text(BUFFERS("{\"byteLength\":4,\"uri\":\"data:;base64,AAAA\"}", "\"buffer\":0,"),
                "a.gltf: buffers[0] is cut off: 3 bytes of 4");
    refuse_text("{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":3,\"uri\":\"data:;base64,AAAA\"}],"
                "\"bufferViews\":[{\"buffer\":0}]," NODE
                "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],"
                "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}",
                "accessors[0]: 3 elements from byte 0 on go beyond bufferViews[0], which has 0 bytes");
    /* The end of a view is compared with the buffer's data, also where the buffer gives no length. */
    refuse_text(BUFFERS("{\"uri\":\"data:;base64,\"}", "\"buffer\":0,"),
                "bufferViews[0]: bytes 0 to 36 go beyond buffers[0], which has 0");
    refuse_text(BUFFERS("{\"byteLength\":3,\"uri\":\"data:;base64,AAAA\"}", "\"buffer\":0,"),
                "bufferViews[0]: bytes 0 to 36 go beyond buffers[0], which has 3");
}

static void expect_warning(const char *rest, const char *says)
{
    struct scene *s = gltf_load(rest);
    if (strstr(warnings, says) == NULL) fail_msg("%s", warnings);
    assert_int_equal(n_warnings, 1);
    assert_int_equal(s->n_triangles, 2);
    scene_free(s);
}

static void what_is_left_out_is_counted(void **state)
{
    (void)state;
    static const char zero[64];
    gltf_quad();
    expect_warning(NODE "\"meshes\":[{\"primitives\":[" PRIMITIVE
                        ",{\"attributes\":{\"NORMAL\":0}},{\"attributes\":{}}]}]," ACCESSORS "]",
                   "2 primitives without POSITION left out");
#define SKIN "\"nodes\":[{\"mesh\":0,\"skin\":0},{}],\"skins\":[{\"joints\":[1]}],"
    gltf_quad();
    expect_warning(SKIN MESH ACCESSORS "]", "1 primitives have a skin and no JOINTS_0: no joint moves them");
    gltf_quad();
    gltf_block(zero, 16, "");
    gltf_block(zero, 64, "");
    expect_warning(SKIN "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"JOINTS_0\":3,\"WEIGHTS_0\":4},"
                        "\"indices\":2}]}]," ACCESSORS
                        ",{\"bufferView\":3,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},"
                        "{\"bufferView\":4,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"}]",
                   "4 vertices of a skin have no weights: no joint moves them");
}

/* A name ends at a NUL. */
static void cut_names_are_counted(void **state)
{
    (void)state;
    gltf_quad();
    struct scene *s = gltf_load(
        "\"nodes\":[{\"mesh\":0,\"name\":\"wall\\u0000 of\"}],\"materials\":[{\"name\":\"a\\u0000\"}]," MESH ACCESSORS
        "]");
    assert_string_equal(s->surface[0].object, "wall");
    assert_non_null(strstr(warnings, "2 names have a \\u0000, and are read up to there"));
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(contradictions_are_named),    cmocka_unit_test(views_beyond_their_buffer_are_named),
        cmocka_unit_test(versions_and_data_are_named), cmocka_unit_test(cut_files_are_named),
        cmocka_unit_test(buffers_are_named),           cmocka_unit_test(what_is_left_out_is_counted),
        cmocka_unit_test(cut_names_are_counted),
    };
    return cmocka_run_group_tests_name("messages of glTF", tests, make_folder, remove_folder);
}
