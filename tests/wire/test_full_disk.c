/* SPDX-License-Identifier: MIT */
/* Meshes on a disk that gets full. The reason is printed, and what to do. No file of theirs is left, neither under its
 * name nor under that of a part. */
#include <sched.h>
#include <sys/mount.h>

#include "tests/common/thorough.h"
#include "tests/wire/room.h"

static const char CONFIG[] = "head: {profile: sphere, step_deg: 4}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {position_m: [0.31, -0.42, 0.17]}\n  - {position_m: [1.25, 0.5, 0.25]}\n"
                             "output: {layout: polar}\n";
static char disk[96]; /* a folder for file systems of our own; empty: none can be made */

static int count_files(const char *folder, char last[64])
{
    DIR *dir = opendir(folder);
    int n = 0;
    assert_non_null(dir);
    for (const struct dirent *e; (e = readdir(dir)) != NULL;)
        if (e->d_name[0] != '.') {
            n++;
            snprintf(last, 64, "%.63s", e->d_name);
        }
    closedir(dir);
    return n;
}

/* Runs `record` to a file of that ending, with so many KiB for all files or for each. Returns its status. */
static int record(struct wire *wire, const char *ending, unsigned kib)
{
    char line[512], config[96], folder[96], last[64];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(folder, sizeof folder, "%s", disk[0] != '\0' ? disk : wire_path(wire, "files"));
    const char *mesh = strcmp(ending, ".ply") == 0 ? "--mesh" : "";
    snprintf(line, sizeof line, "%s exec '%s' record %s --station all --quiet %s -o %s/a%s",
             disk[0] != '\0' ? "" : "ulimit -f $0;", wire_program(), config, mesh, folder, ending);
    char size[32];
    snprintf(size, sizeof size, disk[0] != '\0' ? "size=%uk" : "%u", kib);
    if (disk[0] != '\0')
        assert_int_equal(mount("none", disk, "tmpfs", 0, size), 0);
    else
        mkdir(folder, 0700);
    const char *const args[] = {"-c", line, size, NULL};
    const int status = wire_wait(wire, wire_spawn_program(wire, "/bin/sh", args, "out", "err", -1));
    if (status != 0) {
        char *said = wire_read(wire_path(wire, "err"), NULL);
        const int n = count_files(folder, last);
        if (strstr(said, "cannot write: ") == NULL || strstr(said, ": make room, or write to another disk") == NULL)
            fail_msg("%s, %u KiB: %s", ending, kib, said);
        if (n != 0) fail_msg("%s, %u KiB: %d files are left, %s among them", ending, kib, n, last);
        free(said);
    }
    if (disk[0] != '\0') {
        assert_int_equal(umount(disk), 0);
    } else {
        snprintf(line, sizeof line, "rm -rf '%s'", folder);
        assert_int_equal(system(line), 0);
    }
    return status;
}

/* Each disk is about twice as large as the one before (with THOROUGH=1 a third larger), until all has room. */
static void nothing_is_left(void **state)
{
    static const char *const endings[] = {".obj", ".gltf", ".glb", ".fbx", ".ply"};
    struct wire *wire = *state;
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        int n_full = 0, status = 1;
        for (unsigned kib = 4; status != 0 && kib < 1 << 16; kib += 4 + kib / (unsigned)thorough(12, 4) * 4) {
            status = record(wire, endings[i], kib);
            assert_in_range(status, 0, 1);
            n_full += status;
        }
        assert_int_equal(status, 0);
        assert_true(n_full >= 3);
    }
}

static int set_up(void **state)
{
    if (wire_setup(state) != 0) return -1;
    struct wire *wire = *state;
    room_write(wire);
    wire_write_text(wire, "config.yaml", CONFIG);
    snprintf(disk, sizeof disk, "%s/disk", wire->dir);
    if (mkdir(disk, 0700) == 0 && unshare(CLONE_NEWNS) == 0 && mount("none", "/", NULL, MS_REC | MS_PRIVATE, NULL) == 0)
        return 0;
    print_message("# no disk of its own can be made: limits on the size of files stand for it\n");
    rmdir(disk);
    disk[0] = '\0';
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(nothing_is_left, set_up, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
