"""Operations in time: scenarios, what excites them, contact, payout, faults."""
