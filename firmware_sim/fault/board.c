/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/board.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

enum { MAX_LISTENERS = 4 };

struct fault_board {
    pthread_mutex_t lock;
    _Atomic uint32_t version;
    struct fault_entry entry[FAULT_MAX], gone[FAULT_MAX];
    uint32_t n, last_number;
    uint64_t n_gone; /* number of faults that were taken out; gone is a ring with the last of them */
    struct truth *truth;
    uint64_t *injected; /* by number; 0: all together */
    size_t counted;     /* room in injected */
    struct {
        void (*heard)(void *ctx, const struct fault_note *note);
        void *ctx;
    } listener[MAX_LISTENERS];
    uint32_t n_listeners;
};

int fault_board_create(const struct fault_list *list, const char *truth_path, _Atomic uint64_t *lost,
                       struct fault_board **out, struct sh_err *err)
{
    struct fault_board *board = calloc(1, sizeof *board);
    *out = NULL;
    if (board == NULL) return sh_fail(err, SH_ENOMEM, "faults: no memory");
    int rc = grow(&board->injected, &board->counted, FAULT_MAX + 1, sizeof *board->injected)
                 ? SH_OK
                 : sh_fail(err, SH_ENOMEM, "faults: no memory");
    if (rc == SH_OK) rc = truth_open(truth_path, lost, &board->truth, err);
    if (rc != SH_OK) {
        free(board->injected);
        free(board);
        return rc;
    }
    memset(board->injected, 0, board->counted * sizeof *board->injected);
    pthread_mutex_init(&board->lock, NULL);
    for (uint32_t i = 0; i < list->n; i++)
        board->entry[board->n++] =
            (struct fault_entry){.number = i + 1, .until_ns = INT64_MAX, .from_start = 1, .fault = list->fault[i]};
    board->last_number = board->n;
    atomic_store(&board->version, board->n != 0);
    *out = board;
    return SH_OK;
}

int fault_board_close(struct fault_board *board, struct sh_err *err)
{
    if (board == NULL) return SH_OK;
    const int rc = truth_close(board->truth, err);
    board->truth = NULL;
    return rc;
}

int fault_board_is_filling(const struct fault_board *board)
{
    return truth_is_filling(board->truth);
}

void fault_board_free(struct fault_board *board)
{
    if (board == NULL) return;
    truth_close(board->truth, NULL);
    pthread_mutex_destroy(&board->lock);
    free(board->injected);
    free(board);
}

uint32_t fault_board_version(const struct fault_board *board)
{
    return atomic_load_explicit(&board->version, memory_order_acquire);
}

uint32_t fault_board_copy(struct fault_board *board, struct fault_entry entries[FAULT_MAX], uint32_t *n)
{
    pthread_mutex_lock(&board->lock);
    for (uint32_t i = 0; i < board->n; i++)
        entries[i] = board->entry[i];
    *n = board->n;
    const uint32_t version = atomic_load(&board->version);
    pthread_mutex_unlock(&board->lock);
    return version;
}

uint32_t fault_board_copy_all(struct fault_board *board, struct fault_entry entries[FAULT_KEPT], uint32_t *n)
{
    pthread_mutex_lock(&board->lock);
    *n = board->n;
    memcpy(entries, board->entry, board->n * sizeof *entries);
    for (uint32_t i = 0; i < FAULT_MAX && i < board->n_gone; i++)
        entries[(*n)++] = board->gone[i];
    const uint32_t version = atomic_load(&board->version);
    pthread_mutex_unlock(&board->lock);
    return version;
}

const void *fault_find(const void *items, uint32_t n, size_t size, uint32_t number)
{
    const char *item = items;
    for (uint32_t i = 0; i < n; i++, item += size)
        if (*(const uint32_t *)(const void *)item == number) return item;
    return NULL;
}

/* Returns a number for a new fault, whose count begins at 0. Without memory the function returns 0. */
static uint32_t board_take_number(struct fault_board *board)
{
    const uint32_t number = board->last_number + 1;
    if (!grow(&board->injected, &board->counted, number + (size_t)1, sizeof *board->injected)) return 0;
    board->injected[number] = 0;
    return board->last_number = number;
}

int fault_board_add(struct fault_board *board, const struct fault *fault, int64_t t_ns, uint32_t *number,
                    struct sh_err *err)
{
    int rc = SH_OK;
    pthread_mutex_lock(&board->lock);
    if (board->n == FAULT_MAX) {
        rc = sh_fail(err, SH_EINPUT, "there are %d faults already; allowed %d", FAULT_MAX, FAULT_MAX);
    } else if (board->last_number >= FAULT_MOST_OF_A_RUN) {
        rc = sh_fail(err, SH_EINPUT, "there were %u faults in this run; allowed %d; a new run counts anew",
                     board->last_number, FAULT_MOST_OF_A_RUN);
    } else if ((*number = board_take_number(board)) == 0) {
        rc = sh_fail(err, SH_ENOMEM, "no memory for another fault");
    } else {
        board->entry[board->n++] =
            (struct fault_entry){.number = *number, .since_ns = t_ns, .until_ns = INT64_MAX, .fault = *fault};
        atomic_fetch_add(&board->version, 1);
    }
    pthread_mutex_unlock(&board->lock);
    return rc;
}

uint32_t fault_board_end(struct fault_board *board, uint32_t number, int64_t t_ns)
{
    uint32_t kept = 0;
    pthread_mutex_lock(&board->lock);
    const uint32_t before = board->n;
    for (uint32_t i = 0; i < before; i++) {
        if (number != 0 && board->entry[i].number != number) {
            board->entry[kept++] = board->entry[i];
            continue;
        }
        struct fault_entry *gone = &board->gone[board->n_gone++ % FAULT_MAX];
        *gone = board->entry[i];
        gone->until_ns = t_ns;
    }
    board->n = kept;
    if (kept != before) atomic_fetch_add(&board->version, 1);
    pthread_mutex_unlock(&board->lock);
    return before - kept;
}

void fault_board_note(struct fault_board *board, const struct fault_note *note)
{
    if (!note->ended) {
        pthread_mutex_lock(&board->lock);
        board->injected[0]++;
        board->injected[note->fault]++;
        pthread_mutex_unlock(&board->lock);
    }
    truth_write(board->truth, note);
    for (uint32_t i = 0; i < board->n_listeners; i++)
        board->listener[i].heard(board->listener[i].ctx, note);
}

uint32_t fault_board_last(struct fault_board *board)
{
    pthread_mutex_lock(&board->lock);
    const uint32_t number = board->last_number;
    pthread_mutex_unlock(&board->lock);
    return number;
}

uint64_t fault_board_injected(struct fault_board *board, uint32_t number)
{
    pthread_mutex_lock(&board->lock);
    const uint64_t n = number <= board->last_number ? board->injected[number] : 0;
    pthread_mutex_unlock(&board->lock);
    return n;
}

void fault_board_listen(struct fault_board *board, void (*heard)(void *ctx, const struct fault_note *note), void *ctx)
{
    board->listener[board->n_listeners].heard = heard;
    board->listener[board->n_listeners++].ctx = ctx;
}
