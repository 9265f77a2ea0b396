/* SPDX-License-Identifier: MIT */
/* Materials of meshes that Assimp reads, on Collada: where texture coordinates lie, colours,
 * transparency, and what is said of the rest. Also what moves meshes (morph
 * targets on FBX), and files without any. And the functions through which Assimp reads files. */
#include <math.h>

#include "core/import/import_open.h"
#include "tests/unit/scene_files.h"

/* A square of two triangles, z up, which Assimp turns to y up. Its first set of texture coordinates spans the square;
 * in the second one all are 0.5. Slots: the diffuse part, and the rest of the effect. */
static const char DAE[] =
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
    "<asset><unit meter=\"1\"/><up_axis>Z_UP</up_axis></asset>"
    "<library_images><image id=\"i\"><init_from>m.png</init_from></image></library_images>"
    "<library_effects><effect id=\"e\"><profile_COMMON>"
    "<newparam sid=\"s\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam>"
    "<newparam sid=\"p\"><sampler2D><source>s</source></sampler2D></newparam>"
    "<technique sid=\"c\"><lambert><diffuse>%s</diffuse>%s</lambert></technique></profile_COMMON></effect>"
    "</library_effects>"
    "<library_materials><material id=\"m\" name=\"paint\"><instance_effect url=\"#e\"/></material></library_materials>"
    "<library_geometries><geometry id=\"g\"><mesh>"
    "<source id=\"gp\"><float_array id=\"gpa\" count=\"12\">0 0 0 1 0 0 1 1 0 0 1 0</float_array>"
    "<technique_common><accessor source=\"#gpa\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
    "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
    "<source id=\"gu\"><float_array id=\"gua\" count=\"8\">0 0 1 0 1 1 0 1</float_array>"
    "<technique_common><accessor source=\"#gua\" count=\"4\" stride=\"2\"><param name=\"S\" type=\"float\"/>"
    "<param name=\"T\" type=\"float\"/></accessor></technique_common></source>"
    "<source id=\"gh\"><float_array id=\"gha\" count=\"8\">.5 .5 .5 .5 .5 .5 .5 .5</float_array>"
    "<technique_common><accessor source=\"#gha\" count=\"4\" stride=\"2\"><param name=\"S\" type=\"float\"/>"
    "<param name=\"T\" type=\"float\"/></accessor></technique_common></source>"
    "<vertices id=\"gv\"><input semantic=\"POSITION\" source=\"#gp\"/></vertices>"
    "<triangles count=\"2\" material=\"m\"><input semantic=\"VERTEX\" source=\"#gv\" offset=\"0\"/>"
    "<input semantic=\"TEXCOORD\" source=\"#gu\" offset=\"0\" set=\"0\"/>"
    "<input semantic=\"TEXCOORD\" source=\"#gh\" offset=\"0\" set=\"1\"/><p>0 1 2 0 2 3</p></triangles>"
    "</mesh></geometry></library_geometries>"
    "<library_visual_scenes><visual_scene id=\"v\"><node id=\"n\"><instance_geometry url=\"#g\"><bind_material>"
    "<technique_common><instance_material symbol=\"m\" target=\"#m\"><bind_vertex_input semantic=\"UV\" "
    "input_semantic=\"TEXCOORD\" input_set=\"0\"/></instance_material></technique_common></bind_material>"
    "</instance_geometry></node></visual_scene></library_visual_scenes>"
    "<scene><instance_visual_scene url=\"#v\"/></scene></COLLADA>";

#define TEXTURE(more) "<texture texture=\"p\" texcoord=\"UV\">" more "</texture>"
#define MAYA(lay)     "<extra><technique profile=\"MAYA\">" lay "</technique></extra>"

static struct scene *load_dae(const char *diffuse, const char *rest)
{
    static char text[8192];
    struct scene *scene;
    struct sh_err err;
    snprintf(text, sizeof text, DAE, diffuse, rest);
    const struct scene_mesh_spec spec = {
        .file = write_text("m.dae", text), .up = SCENE_UP_Y, .scale = 1, .textures = 1};
    if (load_spec(&spec, 1, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    unlink(path);
    assert_int_equal(scene->n_triangles, 2);
    return scene;
}

/* Each coordinate is scaled, then shifted. */
static void expect_uv(const struct scene *s, double scale_x, double scale_y, double shift_x, double shift_y)
{
    for (uint32_t i = 0; i < 2; i++)
        for (int c = 0; c < 3; c++) {
            const double *v = s->vertex_m[s->triangle[i][c]];
            assert_true(fabs((double)s->uv[i][c][0] - (scale_x * v[0] + shift_x)) < 1e-6);
            assert_true(fabs((double)s->uv[i][c][1] - (scale_y * v[1] + shift_y)) < 1e-6);
        }
}

static void coordinates_are_scaled_and_shifted(void **state)
{
    (void)state;
    struct scene *s = load_dae(TEXTURE(""), "");
    assert_int_equal(s->surface[0].texture, 1);
    expect_uv(s, 1, 1, 0, 0);
    scene_free(s);
    s = load_dae(TEXTURE(MAYA("<repeatU>2</repeatU><repeatV>0.5</repeatV>"
                              "<offsetU>0.25</offsetU><offsetV>0.125</offsetV>")),
                 "");
    expect_uv(s, 2, 0.5, 0.25, 0.125);
    assert_null(strstr(warnings, "rotated"));
    scene_free(s);
    s = load_dae(TEXTURE(MAYA("<repeatU>2</repeatU><rotateUV>30</rotateUV>")), "");
    assert_non_null(
        strstr(warnings, "m.dae: the textures of 1 meshes are rotated: they are read without the rotation"));
    scene_free(s);
}

static void a_texture_has_its_set_of_coordinates(void **state)
{
    (void)state;
    struct scene *s = load_dae("<texture texture=\"p\" texcoord=\"CHANNEL1\"/>", "");
    assert_int_equal(s->surface[0].texture, 1);
    expect_uv(s, 0, 0, 0.5, 0.5);
    scene_free(s);
    s = load_dae("<texture texture=\"p\" texcoord=\"CHANNEL2\"/>", ""); /* without such a set it is the first */
    expect_uv(s, 1, 1, 0, 0);
    scene_free(s);
}

/* Colours of Collada are sRGB. A colour with a part beyond 1 is left out. */
static void colours_and_transparency(void **state)
{
    (void)state;
    struct scene *s = load_dae("<color>0.25 0.5 0.75 1</color>", "");
    assert_string_equal(s->surface[0].material, "paint");
    assert_int_equal(s->surface[0].has_colour, 1);
    assert_true(s->surface[0].colour[0] == 0.25f && s->surface[0].colour[1] == 0.5f &&
                s->surface[0].colour[2] == 0.75f);
    assert_true(s->surface[0].clear == 0);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    s = load_dae("<color>1 1 1 1</color>", "<transparent opaque=\"A_ONE\"><color>1 1 1 1</color></transparent>"
                                           "<transparency><float>0.25</float></transparency>");
    assert_true(fabs((double)s->surface[0].clear - 0.75) < 1e-6); /* A_ONE: 1 is opaque */
    scene_free(s);
    static const char *const beyond[] = {"<color>1.5 0 0 1</color>", "<color>0 1.5 0 1</color>",
                                         "<color>0 0 -0.5 1</color>"};
    for (int k = 0; k < 3; k++) {
        s = load_dae(beyond[k], "");
        assert_int_equal(s->surface[0].has_colour, 0);
        assert_non_null(
            strstr(warnings, "m.dae: 1 material with a colour beyond 0 to 1, which is left out; the first is 'paint'"));
        assert_int_equal(n_warnings, 1);
        scene_free(s);
    }
}

/* Warnings of Assimp itself are passed on. The triangles have the material "q", which the node binds to nothing. */
static void warnings_of_the_reader_are_passed_on(void **state)
{
    (void)state;
    struct scene *s;
    struct sh_err err;
    char text[8192];
    snprintf(text, sizeof text, DAE, "<color>1 1 1 1</color>", "");
    strstr(text, "material=\"m\"")[10] = 'q';
    const struct scene_mesh_spec spec = {.file = write_text("m.dae", text), .up = SCENE_UP_Y, .scale = 1};
    if (load_spec(&spec, 1, &s, &err) != SH_OK) fail_msg("%s", err.text);
    if (strstr(warnings, "m.dae: 1 warnings while it was read, the first: Collada: No material") == NULL)
        fail_msg("%s", warnings);
    unlink(path);
    scene_free(s);
}

/* Assimp seeks from the begin, from where it is and from the end, as fseek does. Asking for the size moves nothing. */
static void files_are_read_anywhere(void **state)
{
    (void)state;
    FILE *stream = fopen(write_text("ten.txt", "0123456789"), "rb");
    assert_non_null(stream);
    struct aiFile file = import_open_stream(stream);
    static const struct {
        enum aiOrigin origin;
        int by;
        size_t at;
    } row[] = {{aiOrigin_SET, 3, 3}, {aiOrigin_CUR, 4, 7}, {aiOrigin_CUR, -2, 5}, {aiOrigin_END, -1, 9}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        assert_int_equal(file.SeekProc(&file, (size_t)row[i].by, row[i].origin), aiReturn_SUCCESS);
        assert_int_equal(file.FileSizeProc(&file), 10);
        assert_int_equal(file.TellProc(&file), row[i].at);
    }
    assert_int_equal(file.SeekProc(&file, (size_t)-11, aiOrigin_END), aiReturn_FAILURE);
    char digit;
    assert_true(file.ReadProc(&file, &digit, 1, 1) == 1 && digit == '9');
    fclose(stream);
    unlink(path);
}

/* The square, as two triangles or as one polygon, is mirrored at the plane x = 0 of the file. It still looks up, and
 * texture coordinates stay with their corners: u is x of the file, which is -x now. */
static void a_mirrored_node_keeps_its_outer_side(void **state)
{
    (void)state;
    static const char triangles[] = "<triangles count=\"2\" material=\"m\">", list[] = "<p>0 1 2 0 2 3</p></triangles>";
    static char text[8192], changed[8192];
    for (int is_polygon = 0; is_polygon < 2; is_polygon++) {
        struct scene *s;
        struct sh_err err;
        snprintf(text, sizeof text, DAE, TEXTURE(""), "");
        const char *node = strstr(text, "<instance_geometry"), *of = strstr(text, triangles), *p = strstr(text, list);
        snprintf(changed, sizeof changed, "%.*s%s%.*s%s%.*s<scale>-1 1 1</scale>%s", (int)(of - text), text,
                 is_polygon ? "<polylist count=\"1\" material=\"m\">" : triangles,
                 (int)(p - of - (long)strlen(triangles)), of + strlen(triangles),
                 is_polygon ? "<vcount>4</vcount><p>0 1 2 3</p></polylist>" : list,
                 (int)(node - p - (long)strlen(list)), p + strlen(list), node);
        const struct scene_mesh_spec spec = {
            .file = write_text("m.dae", changed), .up = SCENE_UP_Y, .scale = 1, .textures = 1, .offset_m = {0, 0, 1}};
        if (load_spec(&spec, 1, &s, &err) != SH_OK) fail_msg("%s", err.text);
        unlink(path);
        assert_true(s->n_triangles == 2 && s->max_m[0] == 0 && s->min_m[0] == -1);
        assert_true(fabs(total_volume(s) - 1.0 / 3.0) < 1e-6); /* from the origin up to a square at 1 m */
        for (int i = 0; i < 6; i++)
            assert_true((double)s->uv[i / 3][i % 3][0] == -s->vertex_m[s->triangle[i / 3][i % 3]][0]);
        scene_free(s);
    }
}

/* Assimp would end with an assertion, as if the file were broken. */
static void a_skew_is_refused(void **state)
{
    (void)state;
    static char text[8192], changed[8192];
    snprintf(text, sizeof text, DAE, TEXTURE(""), "");
    const char *node = strstr(text, "<instance_geometry");
    snprintf(changed, sizeof changed, "%.*s<skew>45 1 0 0 0 1 0</skew>%s", (int)(node - text), text, node);
    refuse("m.dae", changed, strlen(changed), "it has a <skew>, which Assimp can't read; allowed are <matrix>");
}

/* A tetrahedron of 1 m with a skin, whose joint is 7 m away. Slot: what the node draws. */
static const char MOVED[] =
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
    "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>"
    "<source id=\"p\"><float_array id=\"pa\" count=\"12\">0 0 0 1 0 0 0 1 0 0 0 1</float_array><technique_common>"
    "<accessor source=\"#pa\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
    "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
    "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
    "<triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
    "<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>"
    "<library_controllers><controller id=\"c\"><skin source=\"#g\">"
    "<source id=\"j\"><Name_array id=\"ja\" count=\"1\">J</Name_array><technique_common>"
    "<accessor source=\"#ja\" count=\"1\"><param type=\"name\"/></accessor></technique_common></source>"
    "<source id=\"b\"><float_array id=\"ba\" count=\"16\">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</float_array>"
    "<technique_common><accessor source=\"#ba\" count=\"1\" stride=\"16\"><param type=\"float4x4\"/></accessor>"
    "</technique_common></source>"
    "<source id=\"w\"><float_array id=\"wa\" count=\"1\">1</float_array><technique_common>"
    "<accessor source=\"#wa\" count=\"1\"><param type=\"float\"/></accessor></technique_common></source>"
    "<joints><input semantic=\"JOINT\" source=\"#j\"/><input semantic=\"INV_BIND_MATRIX\" source=\"#b\"/></joints>"
    "<vertex_weights count=\"4\"><input semantic=\"JOINT\" source=\"#j\" offset=\"0\"/>"
    "<input semantic=\"WEIGHT\" source=\"#w\" offset=\"1\"/><vcount>1 1 1 1</vcount><v>0 0 0 0 0 0 0 0</v>"
    "</vertex_weights></skin></controller></library_controllers>"
    "<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\">%s</node>"
    "<node id=\"J\" sid=\"J\" type=\"JOINT\"><translate>0 7 0</translate></node></visual_scene></library_visual_scenes>"
    "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";

/* The tetrahedron with a morph target that lifts its top by 2 units, half of the way. Assimp reads morph targets of FBX
 * alone. */
static const char MORPH[] = "; FBX 7.3.0 project file\n"
                            "FBXHeaderExtension: {\n"
                            "FBXVersion: 7300\n"
                            "}\n"
                            "Objects: {\n"
                            "Geometry: 1, \"Geometry::g\", \"Mesh\" {\n"
                            "Vertices: *12 { a: 0,0,0,1,0,0,0,1,0,0,0,1 }\n"
                            "PolygonVertexIndex: *12 { a: 0,2,-2,0,1,-4,0,3,-3,1,2,-4 }\n"
                            "}\n"
                            "Geometry: 2, \"Geometry::s\", \"Shape\" {\n"
                            "Indexes: *1 { a: 3 }\n"
                            "Vertices: *3 { a: 0,0,2 }\n"
                            "Normals: *3 { a: 0,0,0 }\n"
                            "}\n"
                            "Model: 3, \"Model::n\", \"Mesh\" {\n"
                            "}\n"
                            "Deformer: 4, \"Deformer::d\", \"BlendShape\" {\n"
                            "}\n"
                            "Deformer: 5, \"SubDeformer::c\", \"BlendShapeChannel\" {\n"
                            "DeformPercent: 50\n"
                            "FullWeights: *1 { a: 100 }\n"
                            "}\n"
                            "}\n"
                            "Connections: {\n"
                            "C: \"OO\",3,0\n"
                            "C: \"OO\",1,3\n"
                            "C: \"OO\",4,1\n"
                            "C: \"OO\",5,4\n"
                            "C: \"OO\",2,5\n"
                            "}\n";

static void warn_of_movers(const char *name, const char *text, const char *warning)
{
    struct scene *s = load_text(name, text);
    for (int k = 0; k < 3; k++)
        assert_true(s->max_m[k] - s->min_m[k] == 1); /* the file's vertices, where they are */
    const bool is_there = strstr(warnings, warning != NULL ? warning : "not applied") != NULL;
    if (is_there != (warning != NULL)) fail_msg("%s", warnings);
    scene_free(s);
}

static void bones_and_morph_targets_are_reported(void **state)
{
    (void)state;
    static const char once[] = "<instance_controller url=\"#c\"><skeleton>#J</skeleton></instance_controller>";
    char text[8192], twice[256];
    snprintf(text, sizeof text, MOVED, "<instance_geometry url=\"#g\"/>");
    warn_of_movers("m.dae", text, NULL);
    snprintf(text, sizeof text, MOVED, once);
    warn_of_movers("m.dae", text,
                   "m.dae: the bones of 1 parts of meshes are not applied: these are read as if they had none");
    snprintf(twice, sizeof twice, "%s%s", once, once);
    snprintf(text, sizeof text, MOVED, twice);
    warn_of_movers("m.dae", text, "the bones of 2 parts of meshes are not applied");
    warn_of_movers("m.fbx", MORPH,
                   "m.fbx: the morph targets of 1 parts of meshes are not applied, whatever their weights");
}

/* Assimp would look for the geometry of a mesh in a controller with morph targets, used or not, and blame the file. */
static void morph_targets_of_collada_are_refused(void **state)
{
    (void)state;
    static const char *const uses[] = {"<instance_controller url=\"#m\"/>", "<instance_geometry url=\"#g\"/>"};
    for (int i = 0; i < 2; i++) {
        char text[8192], changed[8192];
        snprintf(text, sizeof text, MOVED, uses[i]);
        const char *at = strstr(text, "<controller id");
        snprintf(changed, sizeof changed,
                 "%.*s<controller id=\"m\"><morph source=\"#g\"><source id=\"t\"><IDREF_array id=\"ta\" count=\"1\">g"
                 "</IDREF_array></source></morph></controller>%s",
                 (int)(at - text), text, at);
        refuse("m.dae", changed, strlen(changed), "it has a <morph>, which Assimp can't read; allowed are meshes");
    }
}

/* Assimp would make a body of each node, for those who want to see an animation alone. */
static void a_file_without_a_mesh_has_no_bodies(void **state)
{
    (void)state;
    static const char text[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
        "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_visual_scenes><visual_scene id=\"v\">"
        "<node id=\"a\"><translate>0 7 0</translate><node id=\"b\"><translate>5 0 0</translate></node></node>"
        "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#v\"/></scene></COLLADA>";
    refuse("m.dae", text, strlen(text), "it has no triangles");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coordinates_are_scaled_and_shifted),
        cmocka_unit_test(a_texture_has_its_set_of_coordinates),
        cmocka_unit_test(colours_and_transparency),
        cmocka_unit_test(warnings_of_the_reader_are_passed_on),
        cmocka_unit_test(files_are_read_anywhere),
        cmocka_unit_test(a_mirrored_node_keeps_its_outer_side),
        cmocka_unit_test(a_skew_is_refused),
        cmocka_unit_test(bones_and_morph_targets_are_reported),
        cmocka_unit_test(morph_targets_of_collada_are_refused),
        cmocka_unit_test(a_file_without_a_mesh_has_no_bodies),
    };
    return cmocka_run_group_tests_name("collada", tests, make_folder, remove_folder);
}
