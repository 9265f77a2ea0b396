/* SPDX-License-Identifier: MIT */
/* A page saves the points so far: the file is the one that `record` makes of the same frames, it is fetched in pieces,
 * and what fails leaves nothing behind. Run from the top of the source tree. */
#include "tests/unit/commands_rig.h"

#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/watch/save.h"

static struct past *past;
static int n_behind; /* so often the observer is asked before it has read a scan's end */
static struct scanhead *rest;
static struct save *save;
static struct sh_err err;
static atomic_int n_lowered, lowered_to;

/* The product's call comes here: the thread that makes a file has the lowest priority. */
int setpriority(__priority_which_t which, id_t who, int to)
{
    atomic_store(&lowered_to, which == PRIO_PROCESS && who == (id_t)gettid() ? to : -1);
    atomic_fetch_add(&n_lowered, 1);
    return 0;
}

static struct past *growing; /* it takes more frames once a whole piece of it is written; NULL: none does */
static uint64_t n_taken;     /* points */

/* Takes the frames of `rest` until so many points have come in all. */
static void take_points(struct past *to, uint64_t in_all)
{
    struct scanhead_frame frame;
    while (n_taken < in_all) {
        assert_int_equal(scanhead_next(rest, &frame, -1), 0);
        past_take(to, &frame);
        if (frame.type == SCANHEAD_POINTS) n_taken += frame.n_points;
    }
}

/* The product's call comes here, between two pieces of the past. */
size_t fwrite(const void *from, size_t size, size_t n, FILE *f)
{
    size_t (*real)(const void *, size_t, size_t, FILE *);
    void *found = dlsym(RTLD_NEXT, "fwrite");
    memcpy(&real, &found, sizeof real);
    if (n >= PAST_PIECE && growing != NULL) {
        take_points(growing, 130000);
        growing = NULL;
    }
    return real(from, size, n, f);
}

/* Sets the folder for temporary files: `t`, which exists, or another one, which does not. */
static void set_temporary(const char *name)
{
    char path[600], here[512];
    assert_non_null(getcwd(here, sizeof here));
    snprintf(path, sizeof path, "%s/%s", here, name);
    setenv("TMPDIR", path, 1);
}

/* Takes the frames of the recording, up to so many points frames. Returns whether there are more. */
static int take_frames(struct past *to, struct scanhead *sh, uint32_t n_points)
{
    struct scanhead_frame frame;
    while (scanhead_next(sh, &frame, -1) == 0) {
        past_take(to, &frame);
        if (frame.type == SCANHEAD_POINTS && --n_points == 0) return 1;
    }
    return 0;
}

/* Two scans of a floor, as a recording and as frames that a head keeps. */
static int go_there(void **state)
{
    (void)state;
    struct scanhead *sh;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}, {position_m: [3, 0, 2]}]\noutput: {crs: local}\n");
    does(&app_record, "c.yaml -o s.shs -o s.ply --station all --quiet", 0);
    past = past_create(&limits);
    assert_non_null(past);
    assert_int_equal(scanhead_open("s.shs", &sh, NULL, 0), 0);
    assert_int_equal(take_frames(past, sh, UINT32_MAX), 0);
    scanhead_close(sh);
    return mkdir("t", 0777);
}

static int go_back(void **state)
{
    past_free(past);
    return commands_end(state);
}

static int open_save(void **state)
{
    (void)state;
    set_temporary("t");
    atomic_store(&n_lowered, 0);
    save = save_create(&(struct save_source){.past = past});
    return save == NULL;
}

static int close_save(void **state)
{
    (void)state;
    save_free(save);
    save = NULL;
    return 0;
}

/* Asks, and expects this answer. */
static void expect_state(const char *query, const char *want)
{
    struct web_body body;
    if (save_get(save, query, &body, &err) != SH_OK) fail_msg("%s: %s", query, err.text);
    assert_string_equal(body.type, "application/json");
    assert_string_equal(body.bytes, want);
    free(body.bytes);
}

static void expect_error(const char *query, int code, const char *want)
{
    struct web_body body;
    assert_int_equal(save_get(save, query, &body, &err), code);
    assert_string_equal(err.text, want);
}

/* Waits until the file is made, or has failed: the thread that makes it gets a processor some time. */
static void wait_for_file(void)
{
    struct web_body body;
    for (int working = 1; working;) {
        if (save_get(save, "", &body, &err) != SH_OK) return;
        working = strstr(body.bytes, "\"state\":\"working\"") != NULL;
        free(body.bytes);
        if (working) poll(NULL, 0, 1);
    }
}

/* Fetches a file in pieces. Returns its bytes; free them. */
static char *fetch(unsigned number, size_t *len)
{
    char *all = calloc(1, 1 << 20), query[64];
    assert_non_null(all);
    *len = 0;
    for (struct web_body body = {.len = 1}; body.len > 0;) {
        snprintf(query, sizeof query, *len == 0 ? "file=%u" : "file=%u&from=%zu", number, *len);
        if (save_get_piece(save, query, &body, &err) != SH_OK) fail_msg("%s: %s", query, err.text);
        assert_string_equal(body.type, "application/octet-stream");
        assert_true(*len + body.len < 1 << 20);
        memcpy(all + *len, body.bytes, body.len);
        *len += body.len;
        free(body.bytes);
    }
    return all;
}

/* Returns how many files are in folders below t; the folder's own path goes to `folder`. */
static int files_below(char folder[600])
{
    int n = 0;
    DIR *t = opendir("t");
    assert_non_null(t);
    folder[0] = '\0';
    for (const struct dirent *e; (e = readdir(t)) != NULL;) {
        if (e->d_name[0] == '.') continue;
        assert_int_equal(strncmp(e->d_name, "scanhead-save-", 14), 0);
        snprintf(folder, 600, "t/%s", e->d_name);
        DIR *in = opendir(folder);
        assert_non_null(in);
        for (const struct dirent *f; (f = readdir(in)) != NULL;)
            n += f->d_name[0] != '.';
        closedir(in);
    }
    closedir(t);
    return n;
}

static size_t bytes_of(const char *path)
{
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    return (size_t)st.st_size;
}

/* ---- tests */

/* The headers differ in comments alone, which say how the files were made. */
static void same_points(const char *got, size_t len)
{
    char *recorded = contents("s.ply");
    const char *from = strstr(got, "end_header"), *points = strstr(recorded, "end_header");
    const size_t n = bytes_of("s.ply") - (size_t)(points - recorded);
    assert_int_equal(len - (size_t)(from - got), n);
    assert_memory_equal(from, points, n);
    free(recorded);
}

/* Makes a PLY. Standard error goes to a file meanwhile: nobody asked the head for a recorder's words. */
static void make_ply(void)
{
    const int shown = dup(2), on_file = open("stderr", O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0666);
    struct web_body body;
    assert_true(shown >= 0 && dup2(on_file, 2) == 2);
    const int rc = save_get(save, "as=ply", &body, &err);
    if (rc == SH_OK) wait_for_file();
    dup2(shown, 2);
    close(shown);
    close(on_file);
    assert_int_equal(rc, SH_OK);
    has(body.bytes, "\"as\":\"ply\",\"file\":1,");
    free(body.bytes);
    assert_int_equal(bytes_of("stderr"), 0);
}

static void the_file_is_that_of_a_recording(void **state)
{
    (void)state;
    char want[200], folder[600];
    size_t len;
    expect_state("", "{\"state\":\"idle\",\"as\":\"\",\"file\":0,\"bytes\":0,\"gone\":0,\"lost_frames\":0}\n");
    make_ply();
    assert_true(atomic_load(&n_lowered) == 1 && atomic_load(&lowered_to) == 19);
    char *got = fetch(1, &len);
    snprintf(want, sizeof want,
             "{\"state\":\"done\",\"as\":\"ply\",\"file\":1,\"bytes\":%zu,\"gone\":0,\"lost_frames\":0}\n", len);
    expect_state("", want);
    has(got, "comment frames_lost 0 reader_lost 0 ");
    same_points(got, len);
    free(got);
    assert_int_equal(files_below(folder), 1); /* the file of the frames is gone */
}

static struct scanhead *open_frames(struct past **to)
{
    struct scanhead *sh;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    *to = past_create(&limits);
    assert_non_null(*to);
    assert_int_equal(scanhead_open("s.shs", &sh, NULL, 0), 0);
    return sh;
}

static char *saved_ply(const struct save_source *source, size_t *len)
{
    save_free(save);
    save = save_create(source);
    assert_non_null(save);
    make_ply();
    return fetch(1, len);
}

/* Frames that the observer lost are missing in the file, and its header counts them, and no others. The end of the
 * first scan is among them. */
static void lost_frames_are_counted(void **state)
{
    (void)state;
    uint8_t raw[512];
    size_t len;
    struct past *part;
    struct scanhead_frame frame;
    struct scanhead *sh = open_frames(&part);
    const struct native_event event = {.code = NATIVE_EV_READER_LOST, .a = 653, .c = 653};
    const struct scanhead_frame lost = {
        .type = SCANHEAD_EVENT,
        .flags = SCANHEAD_LOCAL,
        .event = SCANHEAD_EV_READER_LOST,
        .event_value = {653, 0, 653},
        .raw = raw,
        .raw_len = native_encode_event(raw, sizeof raw, &event, 0, NATIVE_LOCAL),
    };
    assert_int_equal(take_frames(part, sh, 4), 1);
    do
        assert_int_equal(scanhead_next(sh, &frame, -1), 0);
    while (frame.type != SCANHEAD_EVENT || frame.event != SCANHEAD_EV_SCAN_END);
    past_take(part, &lost);
    assert_int_equal(take_frames(part, sh, UINT32_MAX), 0);
    scanhead_close(sh);
    char *got = saved_ply(&(struct save_source){.past = part}, &len);
    has(got, "comment frames_lost 653 reader_lost 653 ");
    expect_error("as=obj", SH_EINPUT, "as=obj: allowed are las, ply, e57, ptx, pcapng");
    struct web_body body;
    assert_int_equal(save_get(save, "", &body, &err), SH_OK); /* a wrong question does not undo the file */
    has(body.bytes, "\"state\":\"done\"");
    has(body.bytes, "\"lost_frames\":653}");
    free(body.bytes);
    free(got);
    close_save(state);
    past_free(part);
}

/* The observer reads the rest of the scan while the thread waits. */
static int is_behind(void *ctx)
{
    if (--n_behind > 0) return 1;
    assert_int_equal(take_frames(ctx, rest, UINT32_MAX), 0);
    return 0;
}

static void the_end_of_a_scan_is_waited_for(void **state)
{
    (void)state;
    size_t len;
    struct past *part;
    rest = open_frames(&part);
    assert_int_equal(take_frames(part, rest, 4), 1);
    n_behind = 3;
    char *got = saved_ply(&(struct save_source){part, is_behind, part}, &len);
    assert_int_equal(n_behind, 0);
    same_points(got, len);
    free(got);
    close_save(state);
    scanhead_close(rest);
    past_free(part);
}

/* A piece of at least 1 MiB has 52,000 points of 20 bytes. When the first one is written, more points come, and the
 * first and the second go. So the file has the first and the third. All shots meet a wall, so a PLY has all points. */
static void points_that_go_meanwhile_are_counted(void **state)
{
    (void)state;
    char head[2048] = "", want[64];
    unsigned n_points = 0;
    struct web_body body;
    struct past *part = past_create(&(struct past_limits){70000, PAST_MOST_BYTES});
    assert_non_null(part);
    write_text("room.obj", "o room\nv -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nv -5 -5 4\nv 5 -5 4\nv 5 5 4\nv -5 5 4\n"
                           "f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n");
    write_text("room.yaml",
               "head: {profile: sphere, step_deg: 0.6}\noutput: {crs: local}\n"
               "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 2]}]\n");
    does(&app_record, "room.yaml -o room.shs --quiet", 0);
    assert_int_equal(scanhead_open("room.shs", &rest, NULL, 0), 0);
    take_points(part, 60000);
    growing = part;
    save_free(save);
    save = save_create(&(struct save_source){.past = part});
    make_ply();
    assert_null(growing);
    assert_int_equal(save_get_piece(save, "file=1", &body, &err), SH_OK);
    memcpy(head, body.bytes, sizeof head - 1);
    free(body.bytes);
    has(head, "comment frames_lost 1 reader_lost 0 ");
    assert_int_equal(sscanf(strstr(head, "element vertex"), "element vertex %u", &n_points), 1);
    assert_in_range(n_points, 60000, 90000);
    snprintf(want, sizeof want, "\"gone\":%u,\"lost_frames\":0}", (unsigned)n_taken - n_points);
    assert_int_equal(save_get(save, "", &body, &err), SH_OK);
    has(body.bytes, want);
    free(body.bytes);
    close_save(state);
    scanhead_close(rest);
    past_free(part);
}

/* The next file takes the place of the last one, in the same folder. */
static void one_file_is_there_at_a_time(void **state)
{
    (void)state;
    static const char *const as[] = {"las", "e57", "ptx", "pcapng"};
    char folder[600], first[600] = "", begin[64];
    size_t len;
    for (unsigned i = 0; i < 4; i++) {
        struct web_body body;
        char query[16];
        snprintf(query, sizeof query, "as=%s", as[i]);
        assert_int_equal(save_get(save, query, &body, &err), SH_OK);
        free(body.bytes);
        wait_for_file();
        snprintf(begin, sizeof begin, "{\"state\":\"done\",\"as\":\"%s\",\"file\":%u,", as[i], i + 1);
        assert_int_equal(save_get(save, "", &body, &err), SH_OK);
        assert_memory_equal(body.bytes, begin, strlen(begin));
        free(body.bytes);
        free(fetch(i + 1, &len));
        assert_true(len > 1000);
        assert_int_equal(files_below(folder), 1);
        if (i == 0) strcpy(first, folder);
        assert_string_equal(folder, first);
    }
    /* A service may remove the folder meanwhile. */
    char command[700];
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    struct web_body body;
    assert_int_equal(save_get_piece(save, "file=4", &body, &err), SH_EIO);
    has(err.text, "/points.pcapng: No such file or directory");
    assert_int_equal(save_get(save, "as=las", &body, &err), SH_OK);
    free(body.bytes);
    wait_for_file();
    free(fetch(5, &len));
    assert_int_equal(files_below(folder), 1);
    close_save(state);
    assert_int_equal(files_below(folder), 0);
    assert_string_equal(folder, ""); /* the folder went, too */
}

static void wrong_questions(void **state)
{
    (void)state;
    struct web_body body;
    expect_error("as=obj", SH_EINPUT, "as=obj: allowed are las, ply, e57, ptx, pcapng");
    expect_error("as=", SH_EINPUT, "as=: allowed are las, ply, e57, ptx, pcapng");
    expect_error("from=0", SH_EINPUT, "from=0: allowed is as=ENDING, or nothing");
    assert_int_equal(save_get_piece(save, "file=1", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file 1 is not there; /save has the number of the last one");
    assert_int_equal(save_get_piece(save, "", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file is needed: whole numbers from 1 to 1000000000");
    assert_int_equal(save_get_piece(save, "file=0", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file=0: allowed whole numbers from 1 to 1000000000");
    assert_int_equal(save_get_piece(save, "file=1&from=-1", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "from=-1: allowed whole numbers from 0 to 1e+15");
    set_temporary("nowhere");
    assert_int_equal(save_get(save, "as=las", &body, &err), SH_EIO);
    has(err.text, "/nowhere/scanhead-save-");
    has(err.text, ": No such file or directory");
    assert_int_equal(save_get(save, "", &body, &err), SH_EIO);
    has(err.text, "/nowhere/scanhead-save-");
    char name[500];
    memset(name, 'x', sizeof name);
    name[sizeof name - 1] = '\0';
    setenv("TMPDIR", name, 1);
    assert_int_equal(save_get(save, "as=las", &body, &err), SH_EIO);
    has(err.text, "TMPDIR has 499 bytes; allowed are up to 378: xxxxx");
    set_temporary("t");
    assert_int_equal(save_get(save, "as=las", &body, &err), SH_OK); /* it goes on */
    has(body.bytes, "\"file\":1,");
    free(body.bytes);
    wait_for_file();
    assert_int_equal(save_get_piece(save, "file=2", &body, &err), SH_EINPUT);
    /* A file that can't even be begun takes the place of the last one, too. */
    char folder[600], command[700];
    files_below(folder);
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    set_temporary("nowhere");
    assert_int_equal(save_get(save, "as=ply", &body, &err), SH_EIO);
    for (int page = 0; page < 2; page++) {
        assert_int_equal(save_get(save, "", &body, &err), SH_EIO);
        has(err.text, "/nowhere/scanhead-save-");
    }
    assert_int_equal(save_get_piece(save, "file=1", &body, &err), SH_EINPUT);
}

/* Each page that asks is told why there is no file. A limit of a file's length stands for a full disk. */
static void a_failure_leaves_nothing(void **state)
{
    (void)state;
    struct rlimit was, low;
    char folder[600];
    struct web_body body;
    assert_int_equal(past_get(past, "", &body, &err), SH_OK);
    const size_t n_kept = body.len - PAST_HEAD_LEN; /* they are one piece */
    free(body.bytes);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &was), 0);
    low = was;
    for (int of_stream = 0; of_stream < 2; of_stream++) {
        /* Packets are longer than the frames in them. */
        low.rlim_cur = of_stream ? 1000 : n_kept;
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &low), 0);
        assert_int_equal(save_get(save, "as=pcapng", &body, &err), SH_OK);
        free(body.bytes);
        wait_for_file();
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &was), 0);
        for (int page = 0; page < 2; page++) {
            assert_int_equal(save_get(save, "", &body, &err), SH_EIO);
            has(err.text, of_stream ? "/stream.shs: File too large" : "/points.pcapng");
            has(err.text, "File too large");
        }
        assert_int_equal(files_below(folder), 0);
        assert_int_equal(save_get_piece(save, of_stream ? "file=2" : "file=1", &body, &err), SH_EINPUT);
    }
    assert_int_equal(save_get(save, "as=pcapng", &body, &err), SH_OK);
    has(body.bytes, "\"file\":3,");
    free(body.bytes);
    wait_for_file();
    assert_int_equal(files_below(folder), 1);
}

/* While a file is made there is no second one. The end of the watch stops it. */
static void a_file_that_is_being_made(void **state)
{
    (void)state;
    struct web_body body;
    char folder[600];
    for (int i = 0; i < 8; i++) { /* the thread may be quick */
        assert_int_equal(save_get(save, "as=e57", &body, &err), SH_OK);
        free(body.bytes);
        const int rc = save_get(save, "as=las", &body, &err);
        if (rc == SH_OK) free(body.bytes);
        if (rc != SH_OK) assert_string_equal(err.text, "a file is being made (e57); ask again later");
        if (rc != SH_OK) break;
        wait_for_file();
    }
    close_save(state);
    assert_int_equal(files_below(folder), 0);
    assert_string_equal(folder, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_file_is_that_of_a_recording, open_save, close_save),
        cmocka_unit_test_setup_teardown(lost_frames_are_counted, open_save, close_save),
        cmocka_unit_test_setup_teardown(the_end_of_a_scan_is_waited_for, open_save, close_save),
        cmocka_unit_test_setup_teardown(points_that_go_meanwhile_are_counted, open_save, close_save),
        cmocka_unit_test_setup_teardown(one_file_is_there_at_a_time, open_save, close_save),
        cmocka_unit_test_setup_teardown(wrong_questions, open_save, close_save),
        cmocka_unit_test_setup_teardown(a_failure_leaves_nothing, open_save, close_save),
        cmocka_unit_test_setup_teardown(a_file_that_is_being_made, open_save, close_save),
    };
    return cmocka_run_group_tests_name("watch save", tests, go_there, go_back);
}
