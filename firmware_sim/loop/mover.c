/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/mover.h"

#include <stdio.h>
#include <sys/eventfd.h>

void mover_create(struct mover *mover, struct device *device, struct stream *stream)
{
    mover->device = device;
    mover->stream = stream;
    pthread_mutex_init(&mover->lock, NULL);
    pthread_cond_init(&mover->changed, NULL);
}

/* Puts the reply into the box of the session that commanded the move. The session may have gone meanwhile. The box then
 * waits for another move or for none, so the tickets are compared. */
static void deliver(struct mover *mover, const struct move_job *job, const struct command_result *result)
{
    pthread_mutex_lock(&mover->lock);
    if (job->box->ticket == job->ticket) {
        snprintf(job->box->reply, sizeof job->box->reply, "%s", result->reply);
        job->box->done = 1;
    }
    pthread_mutex_unlock(&mover->lock);
    eventfd_write(job->wake_fd, 1);
    stream_poke(mover->stream); /* in the paces that wait, a tick must pass to take the move's event along */
}

static void carry_out(struct mover *mover, const struct move_job *job)
{
    struct command_result result;
    device_plan_move(mover->device);
    device_finish_move(mover->device, stream_released(mover->stream), &result);
    deliver(mover, job, &result);
}

static void *mover_main(void *arg)
{
    struct mover *mover = arg;
    pthread_mutex_lock(&mover->lock);
    for (;;) {
        while (!mover->asked && !mover->ending)
            pthread_cond_wait(&mover->changed, &mover->lock);
        if (!mover->asked) break;
        const struct move_job job = mover->job;
        mover->asked = 0;
        pthread_mutex_unlock(&mover->lock);
        carry_out(mover, &job);
        pthread_mutex_lock(&mover->lock);
    }
    pthread_mutex_unlock(&mover->lock);
    return NULL;
}

void mover_ask(struct mover *mover, struct move_box *box, int wake_fd)
{
    pthread_mutex_lock(&mover->lock);
    const struct move_job job = {++mover->ticket, box, wake_fd};
    box->ticket = job.ticket;
    box->done = 0;
    /* Links still take commands while the run ends. After mover_join nobody would wait for a new thread. */
    if (!mover->running && !mover->ending)
        mover->running = pthread_create(&mover->thread, NULL, mover_main, mover) == 0;
    const int has_thread = mover->running;
    mover->job = job;
    mover->asked = has_thread;
    pthread_cond_signal(&mover->changed);
    pthread_mutex_unlock(&mover->lock);
    if (!has_thread) carry_out(mover, &job);
}

int mover_take(struct mover *mover, struct move_box *box, char reply[COMMAND_MAX_REPLY])
{
    pthread_mutex_lock(&mover->lock);
    const int done = box->done;
    if (done) snprintf(reply, COMMAND_MAX_REPLY, "%s", box->reply);
    if (done) box->ticket = 0;
    box->done = 0;
    pthread_mutex_unlock(&mover->lock);
    return done;
}

void mover_join(struct mover *mover)
{
    pthread_mutex_lock(&mover->lock);
    const int running = mover->running;
    mover->ending = 1;
    mover->running = 0;
    pthread_cond_signal(&mover->changed);
    pthread_mutex_unlock(&mover->lock);
    if (mover->device != NULL) device_end(mover->device); /* ends the planning of a move, and of any later move */
    if (running) pthread_join(mover->thread, NULL);
}
