/* SPDX-License-Identifier: MIT */
/* A page saves the points so far: the file is the one that `record` makes of the same frames, it is fetched in pieces,
 * and what fails leaves nothing behind. Run from the top of the source tree. */
#include "tests/unit/save_rig.h"

#include <dirent.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static struct sh_err err;
static atomic_int n_lowered, lowered_to;

/* The product's call comes here: the thread that makes a file has the lowest priority. */
int setpriority(__priority_which_t which, id_t who, int to)
{
    atomic_store(&lowered_to, which == PRIO_PROCESS && who == (id_t)gettid() ? to : -1);
    atomic_fetch_add(&n_lowered, 1);
    return 0;
}

/* Asks, and expects this answer. */
static void expect_state(const char *query, const char *want)
{
    struct web_body body;
    if (save_get(save_rig, query, &body, &err) != SH_OK) fail_msg("%s: %s", query, err.text);
    assert_string_equal(body.type, "application/json");
    assert_string_equal(body.bytes, want);
    free(body.bytes);
}

static void expect_error(const char *query, int code, const char *want)
{
    struct web_body body;
    assert_int_equal(save_get(save_rig, query, &body, &err), code);
    assert_string_equal(err.text, want);
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

/* ---- tests */

static void the_file_is_that_of_a_recording(void **state)
{
    (void)state;
    char want[200], folder[600];
    size_t len;
    atomic_store(&n_lowered, 0);
    expect_state("", "{\"state\":\"idle\",\"as\":\"\",\"file\":0,\"bytes\":0,\"gone\":0,\"lost_frames\":0}\n");
    save_rig_make_ply();
    assert_true(atomic_load(&n_lowered) == 1 && atomic_load(&lowered_to) == 19);
    char *got = save_rig_fetch(1, &len);
    snprintf(want, sizeof want,
             "{\"state\":\"done\",\"as\":\"ply\",\"file\":1,\"bytes\":%zu,\"gone\":0,\"lost_frames\":0}\n", len);
    expect_state("", want);
    has(got, "comment frames_lost 0 reader_lost 0 ");
    save_rig_same_points(got, len);
    free(got);
    assert_int_equal(files_below(folder), 1); /* the file of the frames is gone */
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
        assert_int_equal(save_get(save_rig, query, &body, &err), SH_OK);
        free(body.bytes);
        save_rig_wait();
        snprintf(begin, sizeof begin, "{\"state\":\"done\",\"as\":\"%s\",\"file\":%u,", as[i], i + 1);
        assert_int_equal(save_get(save_rig, "", &body, &err), SH_OK);
        assert_memory_equal(body.bytes, begin, strlen(begin));
        free(body.bytes);
        free(save_rig_fetch(i + 1, &len));
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
    assert_int_equal(save_get_piece(save_rig, "file=4", &body, &err), SH_EIO);
    has(err.text, "/points.pcapng: No such file or directory");
    assert_int_equal(save_get(save_rig, "as=las", &body, &err), SH_OK);
    free(body.bytes);
    save_rig_wait();
    free(save_rig_fetch(5, &len));
    assert_int_equal(files_below(folder), 1);
    save_rig_close(state);
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
    assert_int_equal(save_get_piece(save_rig, "file=1", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file 1 is not there; /save has the number of the last one");
    assert_int_equal(save_get_piece(save_rig, "", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file is needed: whole numbers from 1 to 1000000000");
    assert_int_equal(save_get_piece(save_rig, "file=0", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "file=0: allowed whole numbers from 1 to 1000000000");
    assert_int_equal(save_get_piece(save_rig, "file=1&from=-1", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "from=-1: allowed whole numbers from 0 to 1e+15");
    save_rig_set_temporary("nowhere");
    assert_int_equal(save_get(save_rig, "as=las", &body, &err), SH_EIO);
    has(err.text, "/nowhere/scanhead-save-");
    has(err.text, ": No such file or directory");
    assert_int_equal(save_get(save_rig, "", &body, &err), SH_EIO);
    has(err.text, "/nowhere/scanhead-save-");
    char name[500];
    memset(name, 'x', sizeof name);
    name[sizeof name - 1] = '\0';
    setenv("TMPDIR", name, 1);
    assert_int_equal(save_get(save_rig, "as=las", &body, &err), SH_EIO);
    has(err.text, "TMPDIR has 499 bytes; allowed are up to 378: xxxxx");
    save_rig_set_temporary("t");
    assert_int_equal(save_get(save_rig, "as=las", &body, &err), SH_OK); /* it goes on */
    has(body.bytes, "\"file\":1,");
    free(body.bytes);
    save_rig_wait();
    assert_int_equal(save_get_piece(save_rig, "file=2", &body, &err), SH_EINPUT);
    /* A file that can't even be begun takes the place of the last one, too. */
    char folder[600], command[700];
    files_below(folder);
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    save_rig_set_temporary("nowhere");
    assert_int_equal(save_get(save_rig, "as=ply", &body, &err), SH_EIO);
    for (int page = 0; page < 2; page++) {
        assert_int_equal(save_get(save_rig, "", &body, &err), SH_EIO);
        has(err.text, "/nowhere/scanhead-save-");
    }
    assert_int_equal(save_get_piece(save_rig, "file=1", &body, &err), SH_EINPUT);
}

/* Each page that asks is told why there is no file. A limit of a file's length stands for a full disk. */
static void a_failure_leaves_nothing(void **state)
{
    (void)state;
    struct rlimit was, low;
    char folder[600];
    struct web_body body;
    assert_int_equal(past_get(save_rig_past, "", &body, &err), SH_OK);
    const size_t n_kept = body.len - PAST_HEAD_LEN; /* they are one piece */
    free(body.bytes);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &was), 0);
    low = was;
    for (int of_stream = 0; of_stream < 2; of_stream++) {
        /* Packets are longer than the frames in them. */
        low.rlim_cur = of_stream ? 1000 : n_kept;
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &low), 0);
        assert_int_equal(save_get(save_rig, "as=pcapng", &body, &err), SH_OK);
        free(body.bytes);
        save_rig_wait();
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &was), 0);
        for (int page = 0; page < 2; page++) {
            assert_int_equal(save_get(save_rig, "", &body, &err), SH_EIO);
            has(err.text, of_stream ? "/stream.shs: File too large" : "/points.pcapng");
            has(err.text, "File too large");
        }
        assert_int_equal(files_below(folder), 0);
        assert_int_equal(save_get_piece(save_rig, of_stream ? "file=2" : "file=1", &body, &err), SH_EINPUT);
    }
    assert_int_equal(save_get(save_rig, "as=pcapng", &body, &err), SH_OK);
    has(body.bytes, "\"file\":3,");
    free(body.bytes);
    save_rig_wait();
    assert_int_equal(files_below(folder), 1);
}

/* While a file is made there is no second one. The end of the watch stops it. */
static void a_file_that_is_being_made(void **state)
{
    (void)state;
    struct web_body body;
    char folder[600];
    for (int i = 0; i < 8; i++) { /* the thread may be quick */
        assert_int_equal(save_get(save_rig, "as=e57", &body, &err), SH_OK);
        free(body.bytes);
        const int rc = save_get(save_rig, "as=las", &body, &err);
        if (rc == SH_OK) free(body.bytes);
        if (rc != SH_OK) assert_string_equal(err.text, "a file is being made (e57); ask again later");
        if (rc != SH_OK) break;
        save_rig_wait();
    }
    save_rig_close(state);
    assert_int_equal(files_below(folder), 0);
    assert_string_equal(folder, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_file_is_that_of_a_recording, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(one_file_is_there_at_a_time, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(wrong_questions, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(a_failure_leaves_nothing, save_rig_open, save_rig_close),
        cmocka_unit_test_setup_teardown(a_file_that_is_being_made, save_rig_open, save_rig_close),
    };
    return cmocka_run_group_tests_name("watch save", tests, save_rig_begin, save_rig_end);
}
