/* SPDX-License-Identifier: MIT */
/* Files that meshes name, as other machines wrote the names: with other slashes, folders and cases. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/scene.h"
#include "tests/common/cases.h"

static char dir[] = "/tmp/scanhead-find-XXXXXX", first[64], second[64];
static const char *const made[] = {"a/Wood.PNG", "a/sub/Stone.png", "b/wood.png",     "b/tex/x.png",
                                   "b/Same.png", "b/SAME.png",      "b/tex/Tile.JPG", "b/x.png"};

static void path_of(char path[128], const char *name)
{
    snprintf(path, 128, "%s/%s", dir, name);
}

static int make_files(void **state)
{
    (void)state;
    static const char *const folders[] = {"a", "a/sub", "a/dir.png", "b", "b/tex"};
    char path[128];
    if (mkdtemp(dir) == NULL) return -1;
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        path_of(path, folders[i]);
        if (mkdir(path, 0700) != 0) return -1;
    }
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++) {
        path_of(path, made[i]);
        FILE *file = fopen(path, "w");
        if (file == NULL || fclose(file) != 0) return -1;
    }
    snprintf(first, sizeof first, "%s/a/", dir);
    snprintf(second, sizeof second, "%s/b/", dir);
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    static const char *const folders[] = {"b/tex", "b", "a/dir.png", "a/sub", "a"};
    char path[128];
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++) {
        path_of(path, made[i]);
        unlink(path);
    }
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        path_of(path, folders[i]);
        rmdir(path);
    }
    return rmdir(dir);
}

static void expect(const char *const *folder, size_t n, const char *name, const char *want)
{
    char path[128];
    char *got = scene_find_file(folder, n, name, 1);
    if (want != NULL) path_of(path, want);
    if (want == NULL ? got != NULL : got == NULL || strcmp(got, path) != 0)
        fail_msg("%s: %s instead of %s", name, got != NULL ? got : "nothing", want != NULL ? path : "nothing");
    free(got);
}

/* The name itself comes first, in all folders; then its last part; then both in another case. */
static void names_are_searched_in_order(void **state)
{
    (void)state;
    const char *const both[2] = {first, second};
    static const char *const rows[][2] = {{"Wood.PNG", "a/Wood.PNG"},
                                          {"wood.png", "b/wood.png"}, /* exact in b, before any case in a */
                                          {"WOOD.png", "a/Wood.PNG"},
                                          {"sub/Stone.png", "a/sub/Stone.png"},
                                          {"sub\\Stone.png", "a/sub/Stone.png"},
                                          {"SUB\\STONE.PNG", "a/sub/Stone.png"},
                                          {"C:\\maps\\wood.png", "b/wood.png"},
                                          {"/home/other/Wood.PNG", "a/Wood.PNG"},
                                          {"/home/other/tile.jpg", NULL}, /* tex is not named */
                                          {"TEX/tile.jpg", "b/tex/Tile.JPG"},
                                          {"other/WOOD.png", "a/Wood.PNG"},
                                          {"same.png", "b/SAME.png"},   /* the first in byte order */
                                          {"tex/x.png", "b/tex/x.png"}, /* before b/x.png */
                                          {"TEX/X.png", "b/tex/x.png"},
                                          {"no/x.png", "b/x.png"},
                                          {"dir.png", NULL}, /* a folder is no file */
                                          {"sub", NULL},
                                          {"stone", NULL},
                                          {"Stone.png", NULL},
                                          {"", NULL}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect(both, 2, rows[i][0], rows[i][1]);
    const char *const swapped[2] = {second, first};
    expect(swapped, 2, "WOOD.png", "b/wood.png");
    expect(both, 1, "x.png", NULL);
    const char *const four[4] = {first, first, first, second};
    expect(four, 3, "x.png", NULL);
    expect(four, 4, "x.png", "b/x.png");
    expect(both, 0, "Wood.PNG", NULL);
}

/* Folders are read only where any case will do. */
static void names_as_they_stand(void **state)
{
    (void)state;
    const char *const both[2] = {first, second};
    char path[128], *got = scene_find_file(both, 2, "elsewhere/wood.png", 0);
    path_of(path, "b/wood.png");
    assert_non_null(got);
    assert_string_equal(got, path);
    free(got);
    assert_null(scene_find_file(both, 2, "WOOD.png", 0));
}

/* A whole path counts as it is, whatever the folders; a folder may be empty, which is the current one. */
static void whole_paths(void **state)
{
    (void)state;
    char path[128], before[512];
    const char *const one[1] = {second}, *const here[1] = {""};
    path_of(path, "a/Wood.PNG");
    expect(one, 1, path, "a/Wood.PNG");
    path_of(path, "a/WOOD.png"); /* no other case of it counts, but the name in the folder does */
    expect(one, 1, path, "b/wood.png");
    assert_non_null(getcwd(before, sizeof before));
    assert_int_equal(chdir(first), 0);
    char *got = scene_find_file(here, 1, "wood.png", 1);
    assert_int_equal(chdir(before), 0);
    assert_non_null(got);
    assert_string_equal(got, "Wood.PNG");
    free(got);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(names_are_searched_in_order),
                                       cmocka_unit_test(names_as_they_stand), cmocka_unit_test(whole_paths)};
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
