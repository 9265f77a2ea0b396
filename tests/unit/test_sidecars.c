/* SPDX-License-Identifier: MIT */
/* The files that a mesh file names. Folders are read a fixed number of times, however many names lead to no file. */
#include "tests/unit/commands_rig.h"

#include <dirent.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/sidecars.h"

static int n_opened;

DIR *opendir(const char *name)
{
    DIR *(*real)(const char *name);
    void *found = dlsym(RTLD_NEXT, "opendir");
    memcpy(&real, &found, sizeof real);
    n_opened++;
    return real(name);
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0 || mkdir("in", 0777) != 0) return -1;
    write_text("in/Wood.PNG", "x");
    write_text("Stone.png", "x");
    return 0;
}

static int note(void *ctx, const char *name, const char *path)
{
    char *text = ctx;
    snprintf(text + strlen(text), 512 - strlen(text), "%s=%s ", name, path);
    return SH_OK;
}

/* Writes a mesh and its library, which names n images that are nowhere, and two in another case. Returns how many
 * folders were opened in the search. */
static int folders_of(int n)
{
    static char text[1 << 16];
    char found[512] = "";
    struct sh_err err;
    text[0] = '\0';
    for (int i = 0; i < n; i++)
        snprintf(text + strlen(text), sizeof text - strlen(text), "newmtl m%d\nmap_Kd none%d.png\n", i, i);
    strcat(text, "newmtl wood\nmap_Kd wood.png\nnewmtl stone\nmap_Kd STONE.png\n");
    write_text("in/a.mtl", text);
    write_text("a.obj", "mtllib in/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    n_opened = 0;
    if (app_sidecars("a.obj", note, found, &err) != SH_OK) fail_msg("%s", err.text);
    assert_string_equal(found, "in/a.mtl=in/a.mtl wood.png=in/Wood.PNG STONE.png=Stone.png ");
    return n_opened;
}

static void folders_are_read_once(void **state)
{
    (void)state;
    const int few = folders_of(1), many = folders_of(400);
    assert_true(few > 0);
    assert_int_equal(many, few);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(folders_are_read_once),
    };
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
