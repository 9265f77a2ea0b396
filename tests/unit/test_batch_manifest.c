/* SPDX-License-Identifier: MIT */
/* Lines of a campaign's manifest: written lines are read, and torn ones are ignored. And the files that a mesh
 * names. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware_sim/app/sidecars.h"
#include "firmware_sim/app/studio/batch/manifest.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"

static char dir[64];

static int make_dir(void **state)
{
    (void)state;
    strcpy(dir, "/tmp/scanhead-batch-XXXXXX");
    return mkdtemp(dir) == NULL;
}

static int remove_dir(void **state)
{
    char command[128];
    (void)state;
    snprintf(command, sizeof command, "rm -r '%s'", dir);
    return system(command);
}

static const char *path_of(const char *name)
{
    static char path[4][128];
    static int turn;
    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", dir, name);
    return path[turn];
}

static void write_file(const char *name, const char *mode, const char *text)
{
    FILE *f = fopen(path_of(name), mode);
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static struct batch_entry an_entry(uint32_t job, struct batch_file file[2])
{
    static const char sha[] = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
    struct batch_entry entry = {.job = job, .pulses = INT64_MAX, .points = 17, .seconds = 1.25, .n_files = 2};
    file[0] = (struct batch_file){.name = "0001_a.ply", .bytes = 1234};
    file[1] = (struct batch_file){.name = "0001_a.las", .bytes = 0};
    /* The sums differ, so that exchanged ones show. */
    char *const sums[] = {file[0].sha,       file[1].sha,   entry.stream_sha, entry.made.configuration,
                          entry.made.inputs, entry.made.job};
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; i++) {
        strcpy(sums[i], sha);
        sums[i][0] = (char)('a' + i);
    }
    strcpy(entry.made.program, "1.0");
    strcpy(entry.made.engine, "Embree 3, packets of 8, AVX2");
    entry.file = file;
    return entry;
}

struct seen {
    uint32_t job[8];
    int n;
};

static int note(void *ctx, struct batch_entry *entry, struct sh_err *err)
{
    struct seen *seen = ctx;
    struct batch_file file[2];
    const struct batch_entry want = an_entry(entry->job, file);
    (void)err;
    seen->job[seen->n++] = entry->job;
    assert_null(batch_provenance_differs(&want.made, &entry->made));
    assert_true(entry->pulses == want.pulses && entry->points == 17 && entry->n_files == 2);
    assert_true(entry->seconds == 1.25);
    assert_string_equal(entry->stream_sha, want.stream_sha);
    for (int i = 0; i < 2; i++) {
        assert_string_equal(entry->file[i].name, file[i].name);
        assert_string_equal(entry->file[i].sha, file[i].sha);
        assert_true(entry->file[i].bytes == file[i].bytes);
    }
    batch_entry_free(entry);
    return SH_OK;
}

static int warnings;
static void count_warning(void *ctx, const char *text)
{
    (void)ctx;
    (void)text;
    warnings++;
}
static const struct sh_report REPORT = {.warn = count_warning};

static struct seen read_all(void)
{
    struct seen seen = {.n = 0};
    struct sh_err err;
    warnings = 0;
    assert_int_equal(batch_manifest_read(dir, note, &seen, &REPORT, &err), SH_OK);
    return seen;
}

static void add(uint32_t shard, uint32_t job)
{
    struct batch_file file[2];
    const struct batch_entry entry = an_entry(job, file);
    struct sh_err err;
    int fd;
    assert_int_equal(batch_manifest_open(dir, shard, 2, &fd, &err), SH_OK);
    assert_int_equal(batch_manifest_add(fd, &entry, &err), SH_OK);
    close(fd);
}

/* Whatever part of a line is there, the next one begins on a line of its own, and only whole lines count. */
static void test_torn(void **state)
{
    const char *path = path_of("manifest-1-of-2.jsonl");
    char copy[128];
    struct stat st;
    (void)state;
    snprintf(copy, sizeof copy, "%s", path);
    add(1, 1);
    assert_int_equal(stat(copy, &st), 0);
    const off_t line = st.st_size;
    for (off_t left = line - 1; left >= 0; left -= left > 40 ? 37 : 1) {
        assert_int_equal(truncate(copy, left), 0);
        assert_int_equal(read_all().n, 0);
        assert_int_equal(warnings, 0); /* a line that is not whole gives none, even where only its end is missing */
        add(1, 2);
        const struct seen seen = read_all();
        assert_int_equal(seen.n, 1);
        assert_int_equal(seen.job[0], 2);
        assert_int_equal(warnings, 0);
        assert_int_equal(stat(copy, &st), 0);
        assert_int_equal(st.st_size, line);
    }
}

static void test_folder(void **state)
{
    struct sh_err err;
    int fd, second;
    (void)state;
    assert_int_equal(read_all().n, 0);
    add(1, 5);
    add(2, 3);
    add(1, 5);
    write_file("manifest-1-of-2.jsonl", "a", "{\"job\":4}\n");
    write_file("manifest-1-of-2.jsonl.part", "w", "{\"job\":4}\n");
    write_file("manifest-x-of-2.jsonl", "w", "nothing\n");
    add(1, 6);
    const struct seen seen = read_all();
    assert_int_equal(seen.n, 4);
    assert_true(seen.job[0] == 5 && seen.job[1] == 5 && seen.job[2] == 6 && seen.job[3] == 3);
    assert_int_equal(warnings, 1); /* for the line in the middle */
    assert_int_equal(batch_manifest_open(dir, 1, 2, &fd, &err), SH_OK);
    assert_int_equal(batch_manifest_open(dir, 1, 2, &second, &err), SH_ESTATE);
    assert_non_null(strstr(err.text, "shard 1/2"));
    close(fd);
}

static void test_other_lines(void **state)
{
    static const char *const bad[] = {"", "{}", "[]", "{\"job\":1}", "null"};
    struct batch_entry entry;
    struct batch_file file[2];
    char *line = NULL;
    size_t len;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(batch_entry_read(bad[i], &entry), 0);
    /* a file elsewhere is no file of a campaign */
    const struct batch_entry good = an_entry(1, file);
    struct sh_err err;
    int fd;
    strcpy(file[1].name, "../passwd");
    assert_int_equal(batch_manifest_open(dir, 1, 2, &fd, &err), SH_OK);
    assert_int_equal(batch_manifest_add(fd, &good, &err), SH_OK);
    close(fd);
    FILE *f = fopen(path_of("manifest-1-of-2.jsonl"), "r");
    assert_non_null(f);
    assert_true(getline(&line, &len, f) > 0);
    line[strlen(line) - 1] = '\0';
    assert_int_equal(batch_entry_read(line, &entry), 0);
    char *name = strstr(line, "../passwd");
    memcpy(name, "...passwd", 9);
    assert_int_equal(batch_entry_read(line, &entry), 1);
    batch_entry_free(&entry);
    free(line);
    fclose(f);
}

/* A line that does not fit whole is taken back, and the reason is the system's. */
static void a_line_that_does_not_fit(void **state)
{
    struct batch_file file[2];
    const struct batch_entry good = an_entry(1, file);
    struct rlimit before, few;
    struct sh_err err;
    int fd;
    (void)state;
    assert_int_equal(batch_manifest_open(dir, 3, 4, &fd, &err), SH_OK);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    few = before;
    few.rlim_cur = 10;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &few), 0);
    const int rc = batch_manifest_add(fd, &good, &err);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(rc, SH_EIO);
    assert_string_equal(err.text, "the manifest: cannot write: File too large");
    assert_int_equal(lseek(fd, 0, SEEK_END), 0);
    close(fd);
    unlink(path_of("manifest-3-of-4.jsonl"));
}

/* ---- the files that a mesh names */

static int list_name(void *ctx, const char *name, const char *path)
{
    char *all = ctx;
    (void)name;
    snprintf(all + strlen(all), 512 - strlen(all), "%s;", path + strlen(dir));
    return SH_OK;
}

static void expect_beside(const char *mesh, const char *want)
{
    char all[512] = "";
    struct sh_err err;
    assert_int_equal(app_sidecars(path_of(mesh), list_name, all, &err), SH_OK);
    assert_string_equal(all, want);
}

static void test_beside(void **state)
{
    (void)state;
    assert_int_equal(mkdir(path_of("tex"), 0700), 0);
    for (const char *const *name = (const char *const[]){"a.png", "b c.JPG", "tex/d.png", "e.bin", "other.png", NULL};
         *name != NULL; name++)
        write_file(*name, "w", "x");
    write_file("m.obj", "w", "mtllib first.mtl none.mtl\nv 0.1 0.2 0.png\nusemtl a.png\n");
    write_file("first.mtl", "w",
               "newmtl one\nmap_Kd -s 1 1 1 b c.JPG\r\nmap_d tex/d.png\nmap_bump C:\\work\\tex\\a.png\nmap_Ka a.png\n");
    expect_beside("m.obj", "/first.mtl;/b c.JPG;/tex/d.png;/a.png;");
    write_file("m.gltf", "w",
               "{\"buffers\":[{\"uri\":\"e.bin\"}],\"images\":[{\"uri\":\"b%20c.JPG\"},{\"uri\":\"tex/d.png\"}]}");
    expect_beside("m.gltf", "/e.bin;/b c.JPG;/tex/d.png;");
    write_file("m.ply", "w", "ply\ncomment TextureFile a.png\nend_header\nother.png\n");
    expect_beside("m.ply", "/a.png;");
    write_file("tex/lib.mtl", "w", "newmtl one\nmap_Kd d.png\nmap_d a.png\n");
    write_file("sub.obj", "w", "mtllib tex\\lib.mtl\nusemtl other.png\n");
    expect_beside("sub.obj", "/tex/lib.mtl;/tex/d.png;/a.png;/other.png;");
    write_file("tex/other.png", "w", "x"); /* after the library the mesh's own folder comes first again */
    expect_beside("sub.obj", "/tex/lib.mtl;/tex/d.png;/a.png;/other.png;");
    char line[512]; /* a whole path, in another case, by its last part, and with an escape that is in the file's name */
    write_file("p%20q.png", "w", "x");
    write_file("tex/far.png", "w", "x");
    snprintf(line, sizeof line, "v 0 0 0\nusemtl %s\nusemtl TEX/D.PNG\nusemtl nowhere/E.BIN\nusemtl p%%20q.png\n",
             path_of("tex/far.png"));
    write_file("whole.obj", "w", line);
    expect_beside("whole.obj", "/tex/far.png;/tex/d.png;/e.bin;/p%20q.png;");
    assert_int_equal(mkdir(path_of("folder.png"), 0700), 0);
    write_file("folder.obj", "w", "usemtl folder.png\n");
    expect_beside("folder.obj", "");
    assert_int_equal(rmdir(path_of("folder.png")), 0);
    write_file("empty.obj", "w", "");
    expect_beside("empty.obj", "");
}

/* ---- the identity of a job */

/* The end of each text counts: another split into name and value is another job. */
static void test_job_texts(void **state)
{
    static const char *const a[] = {"head.prr_hz=1", "0001", "x"}, *const b[] = {"head.prr_hz=10", "001", "x"};
    struct batch_provenance one, other;
    (void)state;
    batch_provenance_job(&one, a, 3);
    batch_provenance_job(&other, b, 3);
    assert_string_not_equal(one.job, other.job);
    batch_provenance_job(&other, a, 2);
    assert_string_not_equal(one.job, other.job);
    batch_provenance_job(&other, a, 3);
    assert_string_equal(one.job, other.job);
}

/* Each input counts by its contents: the mesh, the file that it names, and the files that this file names. */
static void test_inputs(void **state)
{
    static const char *const inputs[] = {"m.obj",     "first.mtl", "a.png",    "faults.yaml",
                                         "head.yaml", "trees.csv", "ride.csv", "pulse.csv"};
    struct config *cfg = calloc(1, sizeof *cfg);
    struct batch_provenance before, after;
    struct sh_err err;
    (void)state;
    assert_non_null(cfg);
    for (size_t i = 3; i < sizeof inputs / sizeof inputs[0]; i++)
        write_file(inputs[i], "w", "x");
    write_file("config.yaml", "w", "x\n");
    write_file("m.obj", "w", "mtllib first.mtl\nv 0 0 0\n");
    write_file("first.mtl", "w", "newmtl one\nmap_Kd a.png\n");
    write_file("a.png", "w", "x");
    snprintf(cfg->file, sizeof cfg->file, "%s", path_of("config.yaml"));
    snprintf(cfg->scenario_file, sizeof cfg->scenario_file, "%s", path_of("faults.yaml"));
    snprintf(cfg->profile_file, sizeof cfg->profile_file, "%s", path_of("head.yaml"));
    snprintf(cfg->scene.mesh[0].file, sizeof cfg->scene.mesh[0].file, "%s", path_of("m.obj"));
    snprintf(cfg->scene.mesh[0].copies, sizeof cfg->scene.mesh[0].copies, "%s", path_of("trees.csv"));
    snprintf(cfg->platform.file, sizeof cfg->platform.file, "%s", path_of("ride.csv"));
    snprintf(cfg->waveform.pulse_file, sizeof cfg->waveform.pulse_file, "%s", path_of("pulse.csv"));
    cfg->scene.n_meshes = 1;
    for (size_t i = 0; i < sizeof inputs / sizeof inputs[0]; i++) {
        struct batch_cache cache = {0};
        assert_int_equal(batch_provenance_of(cfg, &cache, &before, &REPORT, &err), SH_OK);
        write_file(inputs[i], "a", "\n");
        assert_int_equal(batch_provenance_of(cfg, &cache, &after, &REPORT, &err), SH_OK);
        batch_cache_free(&cache);
        if (strcmp(before.inputs, after.inputs) == 0) fail_msg("%s is no input", inputs[i]);
        assert_string_equal(before.configuration, after.configuration);
    }
    free(cfg);
}

/* The profile of another scanner's head is an input, too. */
static void test_inputs_of_other_scanners(void **state)
{
    struct config *cfg = calloc(1, sizeof *cfg);
    struct batch_provenance made[2];
    struct sh_err err;
    char copy[192];
    (void)state;
    assert_non_null(cfg);
    snprintf(copy, sizeof copy, "cp config/heads/any-rate.yaml '%s'", path_of("own.yaml"));
    assert_int_equal(system(copy), 0);
    write_file("m.obj", "w", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_file("two.yaml", "w",
               "head: {profile: any-rate}\nscene: {meshes: [{file: m.obj, up: z, scale: 1}]}\nstations:\n"
               "  - {position_m: [0, 0, 1]}\n"
               "  - {position_m: [1, 0, 1], scanner: {head: {profile: own.yaml}}}\n");
    for (int i = 0; i < 2; i++) {
        struct batch_cache cache = {0};
        if (config_load(path_of("two.yaml"), NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(batch_provenance_of(cfg, &cache, &made[i], &REPORT, &err), SH_OK);
        batch_cache_free(&cache);
        write_file("own.yaml", "a", "# changed\n");
    }
    assert_string_not_equal(made[0].inputs, made[1].inputs);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_inputs_of_other_scanners, make_dir, remove_dir),
        cmocka_unit_test_setup_teardown(test_torn, make_dir, remove_dir),
        cmocka_unit_test_setup_teardown(a_line_that_does_not_fit, make_dir, remove_dir),
        cmocka_unit_test_setup_teardown(test_folder, make_dir, remove_dir),
        cmocka_unit_test_setup_teardown(test_other_lines, make_dir, remove_dir),
        cmocka_unit_test_setup_teardown(test_beside, make_dir, remove_dir),
        cmocka_unit_test(test_job_texts),
        cmocka_unit_test_setup_teardown(test_inputs, make_dir, remove_dir),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
