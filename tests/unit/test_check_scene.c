/* SPDX-License-Identifier: MIT */
/* The objects of a scene as `check --scene` and --scene-csv have them. Areas and volumes are worked out by hand. Run
 * from the top of the source tree. */
#include "firmware_sim/app/app.h"
#include "tests/unit/output_rig.h"
#include "tests/unit/site_rig.h"

/* part: a rectangle of 2 x 3 m in two colours, with another object between its surfaces. box: 2 x 3 x 4 m. wedge: a
 * tetrahedron, one of whose faces points inward. slope: a triangle, and one without area. */
static const char OBJECTS[] = "mtllib s.mtl\n"
                              "v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nv 0 0 4\nv 2 0 4\nv 2 3 4\nv 0 3 4\n"
                              "v 9 9 9\nv 9 9 9\nv 20 0 0\nv 21 0 0\nv 20 1 0\nv 20 0 1\n"
                              "o part\nusemtl red\nf 1 2 3\n"
                              "o box\nusemtl red\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
                              "o part\nusemtl blue\nf 1 3 4\n"
                              "o wedge\nusemtl plain\nf 11 13 12\nf 11 12 14\nf 11 14 13\nf 12 14 13\n"
                              "o slope, \"steep\"\nf 1 2 9\nf 9 10 9\n";

static char *on_out;
static int n_warned;

static void check(const char *mesh, const char *more, const char *csv)
{
    char text[1024], name[] = "check", scene[] = "--scene", path[128], option[] = "--scene-csv", file[160];
    char *argv[] = {name, path, scene, option, file, NULL};
    struct output out, said;
    write_in("s.mtl", "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nd 0.25\nnewmtl plain\n");
    write_in("s.obj", mesh);
    write_in("b.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 0 1 0 0 1\no body\nf 1 2 3\n");
    snprintf(text, sizeof text,
             "head: {profile: sphere, step_deg: 10}\nscene:\n  meshes:\n    - {file: s.obj, up: z, scale: 1}\n%s"
             "stations: [{position_m: [-1, 1, 1]}]\noutput: {crs: local, colour: texture}\n",
             more);
    write_in("test.yaml", text);
    write_in(csv, "");
    snprintf(path, sizeof path, "%s", config_path);
    snprintf(file, sizeof file, "%.*s/%s", (int)(strrchr(config_path, '/') - config_path), config_path, csv);
    free(on_out);
    output_take(&out, stdout);
    output_take(&said, stderr);
    const int status = app_check.run(5, argv);
    char *warnings = output_give(&said);
    on_out = output_give(&out);
    n_warned = 0;
    for (const char *at = warnings; (at = strstr(at, "scanhead: warning: ")) != NULL; at++)
        n_warned++;
    free(warnings);
    assert_int_equal(status, APP_OK);
}

static char *written(const char *csv)
{
    char file[160], *text = calloc(1, 1 << 16);
    snprintf(file, sizeof file, "%.*s/%s", (int)(strrchr(config_path, '/') - config_path), config_path, csv);
    FILE *in = fopen(file, "r");
    assert_true(in != NULL && text != NULL);
    assert_true(fread(text, 1, (1 << 16) - 1, in) > 0);
    fclose(in);
    return text;
}

/* The wedge has 3 / 2 + root 3 / 2 m2, the slope |(2, 0, 0) x (9, 9, 9)| / 2 = 9 root 2 m2. */
static void all_kinds_of_objects(void **state)
{
    static const char lines[] =
        "objects   4\n"
        "   triangles open edges      area m2    volume m3  body   colour   name\n"
        "          12          0           52           24  closed #ff0000  box\n"
        "           1          3      12.7279            -  open   none     slope, \"steep\"\n"
        "           2          4            6            -  open   several  part\n"
        "           4          0      2.36603            -  turned none     wedge\n"
        "          19          7      73.0939           24  sum: 1 closed, 2 open, 1 turned, 0 empty\n"
        "open      slope, \"steep\", 3 open edges\n"
        "open      part, 4 open edges\n"
        "turned    wedge, neighbouring faces point to opposite sides\n"
        "clear     75 %: part, material blue\n"
        "objects   1 of scene.meshes[1], which moves\n"
        "   triangles open edges      area m2    volume m3  body   colour   name\n"
        "           1          3          0.5            -  open   vertices body\n"
        "           1          3          0.5            0  sum: 0 closed, 1 open, 0 turned, 0 empty\n"
        "open      body, 3 open edges\n"
        "left out  1 triangles without area, 0 points and lines; 0 names shortened to 255 bytes\n"
        "warnings  3, on standard error\n";
    static const char csv[] =
        "object,type,guid,moves,triangles,open_edges,body,area_m2,volume_m3,surfaces,colour,clear\n"
        "part,,,no,2,4,open,6,,2,several,0.75\n"
        "box,,,no,12,0,closed,52,24,1,#ff0000,0\n"
        "wedge,,,no,4,0,turned,2.36602540378,,1,none,0\n"
        "\"slope, \"\"steep\"\"\",,,no,1,3,open,12.7279220614,,1,none,0\n"
        "body,,,yes,1,3,open,0.5,,1,vertices,0\n";
    (void)state;
    check(OBJECTS, "    - {file: b.obj, up: z, scale: 1, move_m_s: [1, 0, 0], offset_m: [0, 8, 1]}\n", "all.csv");
    const char *at = strstr(on_out, "objects ");
    assert_non_null(at);
    assert_string_equal(at, lines);
    assert_int_equal(n_warned, 3); /* a triangle without area, glass, surfaces without a colour */
    char *text = written("all.csv");
    assert_string_equal(text, csv);
    free(text);
    assert_non_null(strstr(on_out, "\nemitter   sphere, 19 rings 10 deg apart, of 36 steps of 10 deg\n"));
    assert_non_null(strstr(on_out, "\nscene     19 triangles, 5 surfaces, x "));
}

/* Up to 50 of each kind are printed. Equally large ones come in the order of the file. */
static void fifty_of_each_kind(void **state)
{
    static const int counts[] = {50, 51, 53};
    (void)state;
    for (int c = 0; c < 3; c++) {
        char *mesh = NULL, line[96];
        size_t len;
        const int n = counts[c];
        FILE *out = open_memstream(&mesh, &len);
        assert_non_null(out);
        fputs("mtllib s.mtl\nusemtl blue\n", out);
        for (int i = 0; i < n; i++)
            fprintf(out, "o leaf%02d\nv %d 0 0\nv %d 0 0\nv %d 1 0\nf %d %d %d\n", i, 3 * i, 3 * i + 2, 3 * i,
                    3 * i + 1, 3 * i + 2, 3 * i + 3);
        fclose(out);
        check(mesh, "", "all.csv");
        free(mesh);
        const char *at = on_out;
        for (int kind = 0; kind < 3; kind++) {
            static const char *const forms[] = {"  open   #0000ff  leaf%02d\n", "open      leaf%02d, 3 open edges\n",
                                                "clear     75 %%: leaf%02d, material blue\n"};
            static const char *const more[] = {"  and %d more; --scene-csv FILE has all\n",
                                               "open      and %d more; --scene-csv FILE has all\n",
                                               "clear     and %d more; --scene-csv FILE has all\n"};
            for (int i = 0; i < 50; i++) {
                snprintf(line, sizeof line, forms[kind], i);
                if ((at = strstr(at, line)) == NULL) fail_msg("%d: no %s", n, line);
            }
            snprintf(line, sizeof line, forms[kind], 50);
            assert_null(strstr(at, line));
            snprintf(line, sizeof line, more[kind], n - 50);
            assert_int_equal(strstr(at, line) != NULL, n > 50);
        }
        snprintf(line, sizeof line, "objects   %d%s\n", n, n > 50 ? ", the largest first" : "");
        assert_non_null(strstr(on_out, line));
    }
    free(on_out);
    on_out = NULL;
}

/* A mesh may have any bytes, also those with which a terminal clears its screen. No line has them. */
static void names_are_one_line(void **state)
{
    (void)state;
    check("mtllib s.mtl\nv 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\no a\033[2Jb\nusemtl blue\nf 1 2 3\n"
          "o c\033d\nusemtl plain\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n",
          "", "odd.csv");
    for (const char *const *line =
             (const char *const[]){"        -  open   #0000ff  a?[2Jb\n", "open      a?[2Jb, 3 open edges\n",
                                   "turned    c?d, neighbouring faces", "clear     75 %: a?[2Jb, material blue\n",
                                   NULL};
         *line != NULL; line++)
        if (strstr(on_out, *line) == NULL) fail_msg("no %s in %s", *line, on_out);
    assert_null(strchr(on_out, '\033'));
    free(on_out);
    on_out = NULL;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_kinds_of_objects), cmocka_unit_test(fifty_of_each_kind),
                                       cmocka_unit_test(names_are_one_line)};
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
