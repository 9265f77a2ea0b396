/* SPDX-License-Identifier: MIT */
/* A journal and a file of the truth whose reader rests for a while: each reports missing lines at their place. A pipe
 * takes the place of a slow disk. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <inttypes.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/device/journal.h"
#include "firmware_sim/fault/truth.h"

enum { MOST_BYTES = 8 << 20 };

static struct pipe_file {
    int end[2];
    char path[32];
    pthread_t reader;
    char *text; /* all that was read */
} file;

static void *read_all(void *arg)
{
    (void)arg;
    size_t len = 0;
    ssize_t n;
    while ((n = read(file.end[0], file.text + len, MOST_BYTES - 1 - len)) > 0)
        len += (size_t)n;
    file.text[len] = '\0';
    return NULL;
}

static int setup(void **state)
{
    (void)state;
    file.text = malloc(MOST_BYTES);
    if (file.text == NULL || pipe(file.end) != 0) return -1;
    snprintf(file.path, sizeof file.path, "/dev/fd/%d", file.end[1]);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(file.text);
    return close(file.end[0]);
}

/* Starts the reader. The file's writer has opened a descriptor of its own. */
static void reader_start(void)
{
    close(file.end[1]);
    assert_int_equal(pthread_create(&file.reader, NULL, read_all, NULL), 0);
}

/* ---- the journal */

static struct {
    uint64_t written, lost, notes, lost_notes;
} counts;

static void put_command(struct journal *journal)
{
    char line[COMMAND_MAX_LINE + 1];
    memset(line, 'y', COMMAND_MAX_LINE);
    line[COMMAND_MAX_LINE] = '\0';
    const int rc = journal_write(journal, 1, 1000000, 1, line);
    counts.written += rc == SH_OK;
    counts.lost += rc == SH_ELOST;
}

static void put_note(struct journal *journal)
{
    const int rc = journal_note(journal, "a note");
    counts.notes += rc == SH_OK;
    counts.lost_notes += rc == SH_ELOST;
}

/* Remarks are given up first, and commands once the queue is full. */
static void a_journal_says_what_is_missing(void **state)
{
    (void)state;
    _Atomic uint64_t lost = 0;
    uint64_t written = 0, missing = 0, notes = 0, missing_notes = 0, n;
    struct sh_err err;
    struct journal *journal = journal_open(file.path, &lost, &err);
    assert_non_null(journal);
    memset(&counts, 0, sizeof counts);
    while (counts.lost_notes == 0)
        put_command(journal), put_note(journal);
    assert_true(counts.lost == 0 && journal_is_filling(journal));
    while (counts.lost < 100)
        put_command(journal);
    reader_start();
    const uint64_t before = counts.written;
    while (counts.written == before) {
        put_command(journal);
        put_note(journal);
        sched_yield();
    }
    assert_int_equal(journal_close(journal, &err), SH_OK);
    pthread_join(file.reader, NULL);
    assert_true(lost == counts.lost + counts.lost_notes);

    assert_int_equal(strncmp(file.text, "# scanhead journal 1\n", 21), 0);
    for (const char *at = file.text + 21, *end; *at != '\0'; at = end + 1) {
        char want[64];
        end = strchr(at, '\n');
        assert_non_null(end);
        want[0] = '\0';
        if (sscanf(at, "LOST %" SCNu64, &n) == 1) {
            snprintf(want, sizeof want, "LOST %" PRIu64 "\n", n);
            missing += n;
        } else if (sscanf(at, "# missing here: %" SCNu64, &n) == 1) {
            snprintf(want, sizeof want, "# missing here: %" PRIu64 " remarks\n", n);
            missing_notes += n;
        } else if (*at == '#') {
            strcpy(want, "# a note\n");
            notes++;
        } else {
            strcpy(want, "1 1000000 1 yyy");
            written++;
        }
        if (strncmp(at, want, strlen(want)) != 0) fail_msg("%.60s", at);
    }
    assert_true(written == counts.written && missing == counts.lost);
    assert_true(notes == counts.notes && missing_notes == counts.lost_notes);
}

/* ---- the truth */

static void the_truth_says_what_is_missing(void **state)
{
    (void)state;
    struct fault_note note = {.fault = 1, .kind = FAULT_DROP, .link = 1, .byte = -1};
    _Atomic uint64_t lost = 0;
    uint64_t all = 0, missing = 0, written = 0, n;
    struct truth *truth;
    struct sh_err err;
    assert_int_equal(truth_open(file.path, &lost, &truth, &err), SH_OK);
    memset(note.text, 'x', sizeof note.text - 1);
    assert_int_equal(truth_is_filling(truth), 0);
    while (atomic_load(&lost) < 100) {
        truth_write(truth, &note);
        all++;
    }
    assert_int_equal(truth_is_filling(truth), 1);
    reader_start();
    for (uint64_t before = 0; before != atomic_load(&lost); all++) { /* until a line is taken again */
        sched_yield();
        before = atomic_load(&lost);
        truth_write(truth, &note);
    }
    assert_int_equal(truth_close(truth, &err), SH_OK);
    pthread_join(file.reader, NULL);
    for (const char *at = file.text, *end; *at != '\0'; at = end + 1) {
        end = strchr(at, '\n');
        assert_non_null(end);
        char want[64] = "{\"fault\":1,\"kind\":\"drop\",";
        if (sscanf(at, "{\"missing\":%" SCNu64, &n) == 1) {
            snprintf(want, sizeof want, "{\"missing\":%" PRIu64 "}\n", n);
            missing += n;
        } else {
            written++;
        }
        if (strncmp(at, want, strlen(want)) != 0) fail_msg("%.60s", at);
    }
    assert_true(missing == lost && written == all - lost);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_journal_says_what_is_missing, setup, teardown),
        cmocka_unit_test_setup_teardown(the_truth_says_what_is_missing, setup, teardown),
    };
    return cmocka_run_group_tests_name("gaps in files", tests, NULL, NULL);
}
